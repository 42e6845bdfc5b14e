//! Finds the axis that is up in a motion's file.

use super::posture::{Posture, foot_contacts_favour, upright_share};
use crate::geometry::{IDENTITY_ROTATION, Mat3, Vec3, about_axis};
use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt;

/// Up axis of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Up {
    /// y.
    #[value(name = "y")]
    Y,
    /// z, as in AMASS.
    #[value(name = "z")]
    Z,
    /// x.
    #[value(name = "x")]
    X,
    /// y points down, as in a camera's axes.
    #[value(name = "-y")]
    MinusY,
    /// z points down.
    #[value(name = "-z")]
    MinusZ,
    /// x points down.
    #[value(name = "-x")]
    MinusX,
}

/// All axes, those that files have the most first.
pub(super) const ALL: [Up; 6] = [Up::Y, Up::Z, Up::MinusY, Up::MinusZ, Up::X, Up::MinusX];

/// Axes that are up in files of many programs: of y up, of z up, and a camera's.
const COMMON: [Up; 3] = [Up::Y, Up::Z, Up::MinusY];
/// If the format does not document the up axis, the person must be upright along it in this share of the frames:
/// standing, walking or sitting.
const LEAST: f64 = 0.2;

impl Up {
    /// The rotation of positions with this axis up to those with y up.
    pub(crate) fn to_y(self) -> Mat3 {
        match self {
            Self::Y => IDENTITY_ROTATION,
            Self::Z => about_axis(0, -FRAC_PI_2),
            Self::X => about_axis(2, FRAC_PI_2),
            Self::MinusY => about_axis(0, PI),
            Self::MinusZ => about_axis(0, FRAC_PI_2),
            Self::MinusX => about_axis(2, -FRAC_PI_2),
        }
    }

    /// The unit vector.
    pub(super) fn vector(self) -> Vec3 {
        match self {
            Self::X => [1.0, 0.0, 0.0],
            Self::Y => [0.0, 1.0, 0.0],
            Self::Z => [0.0, 0.0, 1.0],
            Self::MinusX => [-1.0, 0.0, 0.0],
            Self::MinusY => [0.0, -1.0, 0.0],
            Self::MinusZ => [0.0, 0.0, -1.0],
        }
    }

    /// The axis along which a unit vector along an axis points.
    pub(super) fn of_vector(vector: Vec3) -> Option<Self> {
        ALL.into_iter().find(|up| up.vector() == vector)
    }
}

impl fmt::Display for Up {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
            Self::MinusX => "-x",
            Self::MinusY => "-y",
            Self::MinusZ => "-z",
        })
    }
}

/// An up axis that is known from another source than the motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Usual<'a> {
    pub up: Up,
    /// The source of this axis, for notes.
    pub who: &'a str,
    /// Whether the format documents it: then it is used where the motion does not show the axis.
    pub is_documented: bool,
}

/// The axis that is up in a motion of these `postures`, and a note about it.
///
/// The person is upright along it in more frames than along any other axis. If it is not the `usual` one, or no common
/// program uses it, foot contacts must confirm it: a person who lies is upright along a wrong axis.
///
/// # Errors
/// When the motion does not tell, and the format documents nothing.
pub(super) fn find(postures: &[Posture], usual: Option<Usual<'_>>) -> Result<(Up, String), String> {
    let mut shares = ALL.map(|up| (up, upright_share(postures, up)));
    let is_usual = |up: Up| usual.is_some_and(|usual| usual.up == up);
    shares.sort_by(|a, b| b.1.total_cmp(&a.1).then(is_usual(b.0).cmp(&is_usual(a.0))));
    let [(best, share), (second, less), ..] = shares;
    let percent = |share: f64| format!("{:.0} %", 100.0 * share);
    let said = format!(
        "the person is upright along {best} in {} of the frames",
        percent(share)
    );
    let is_usual = is_usual(best);
    let is_clear = match is_usual {
        true => share > 0.0,
        false => share >= LEAST && less <= 0.5 * share,
    };
    if is_clear && (is_usual || usual.is_none() && COMMON.contains(&best)) {
        return Ok((best, format!("{best} is up: {said} (--up for another)")));
    }
    let against = usual.map_or(Up::Y, |usual| usual.up);
    if is_clear && foot_contacts_favour(postures, best, against) {
        let why = usual.map_or(String::new(), |usual| {
            format!(", although {} has {} up", usual.who, usual.up)
        });
        return Ok((
            best,
            format!(
                "{best} is up{why}: {said}, and the feet step on a level floor below it (--up for another)"
            ),
        ));
    }
    match usual {
        Some(usual) if usual.is_documented => Ok((
            usual.up,
            format!(
                "{} is up, as {} documents, although {said}: if they don't lie, give the axis (--up {best})",
                usual.up, usual.who
            ),
        )),
        Some(usual) if is_clear => Err(format!(
            "{} has {} up, but {said}: does the person lie? Give the axis that is up (--up {} or --up {best})",
            usual.who, usual.up, usual.up
        )),
        None if is_clear => Err(format!(
            "{said}, which no common program has up: does the person lie? Give the axis that is up (--up {best} if not)"
        )),
        _ => Err(format!(
            "the motion does not tell which axis is up: {said}, along {second} in {}. Give the axis (--up {})",
            percent(less),
            ALL.map(|up| up.to_string()).join(", ")
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{add, matvec, transpose};

    /// A person of 1.7 m who walks along z on a floor at y = 0, or only stands, turned to have `up` up.
    fn postures(up: Up, walks: bool) -> Vec<Posture> {
        let turned = |at: Vec3| matvec(&transpose(&up.to_y()), at);
        let posture = |frame: usize| {
            let ahead = if walks { 0.03 * frame as f64 } else { 0.0 };
            let step = |phase: f64| 0.15 * (frame as f64 * 0.3 + phase).sin().max(0.0);
            let foot = |x: f64, phase: f64| {
                let lift = if walks { step(phase) } else { 0.0 };
                turned([x, 0.1 + lift, ahead])
            };
            Posture {
                root: turned([0.0, 0.95, ahead]),
                head: turned([0.0, 1.6, ahead]),
                feet: [foot(0.1, 0.0), foot(-0.1, std::f64::consts::PI)],
            }
        };
        (0..90).map(posture).collect()
    }

    fn usual(up: Up) -> Usual<'static> {
        Usual {
            up,
            who: "the format",
            is_documented: false,
        }
    }

    #[test]
    fn to_y_turns_each_axis_up() {
        for up in ALL {
            let turned = matvec(&up.to_y(), up.vector());
            let off = (0..3).map(|i| (turned[i] - Up::Y.vector()[i]).abs());
            assert!(off.fold(0.0, f64::max) < 1e-12, "{up}: {turned:?}");
            assert_eq!(Up::of_vector(up.vector()), Some(up));
        }
    }

    #[test]
    fn each_axis_is_found_from_a_walk() {
        for up in ALL {
            for usual in [None, Some(usual(Up::Y)), Some(usual(Up::Z))] {
                let found = find(&postures(up, true), usual).map(|(up, _)| up);
                assert_eq!(found, Ok(up), "{usual:?}");
            }
        }
    }

    #[test]
    fn what_may_be_a_person_who_lies_is_refused() {
        let moved = |up: Up, to: Vec3| -> Vec<Posture> {
            let by = |at: Vec3| add(at, to);
            let posture = |posture: Posture| Posture {
                root: by(posture.root),
                head: by(posture.head),
                feet: posture.feet.map(by),
            };
            postures(up, false).into_iter().map(posture).collect()
        };
        // One who stands still may as well lie along a horizontal axis, on a floor at the origin above all.
        for to in [[5.0, 0.0, 0.0], [-0.9, 0.15, 0.0]] {
            let refused = find(&moved(Up::X, to), None).expect_err("may lie");
            assert!(refused.contains("does the person lie"), "{refused}");
        }
        // But not with half of the body below that floor.
        assert!(find(&postures(Up::X, false), None).is_ok());
        let off_the_floor = moved(Up::Y, [0.0, 5.0, 0.0]);
        let refused = find(&off_the_floor, Some(usual(Up::Z))).expect_err("may lie");
        assert!(refused.contains("--up z or --up y"), "{refused}");
        assert!(find(&off_the_floor, Some(usual(Up::Y))).is_ok());
        // Unless the format documents it.
        let documented = Usual {
            is_documented: true,
            ..usual(Up::Z)
        };
        let (up, note) = find(&off_the_floor, Some(documented)).expect("documented");
        assert_eq!(up, Up::Z);
        assert!(note.contains("if they don't lie"), "{note}");
        // Half of the time each.
        let mut both = postures(Up::Y, true);
        both.extend(postures(Up::Z, true));
        let refused = find(&both, None).expect_err("two axes");
        assert!(refused.contains("does not tell"), "{refused}");
    }
}
