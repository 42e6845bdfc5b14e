//! Clothes that move with the pose, by a rule with a known displacement.
//!
//! The model maps an observed point to a point `x_c` in the rest pose by inverse skinning, and adds an
//! offset `Δx(x_c, pose)` to look up the appearance (HumanNeRF, "non-rigid motion"). The rule here is that
//! offset: in a pose, the garment at `x_c` has the shape and colour of the rest garment at `x_c + Δx`.
//! Cloth that moves by `m` therefore has an offset of about `-m`.
//!
//! - A hem swings with each thigh: not at all at the waist, and up to [`SWING`] at the edge. It swings
//!   forward in front of a lifted thigh, backward behind a thigh that is stretched back, and outward with
//!   either.
//! - A sleeve over an elbow slides towards the shoulder and bulges in folds as the elbow bends.

use super::build::joint;
use super::outfit::smooth_step;
use std::f64::consts::TAU;
use yoto_capture::skeleton::transform::{dot, length};
use yoto_capture::skeleton::{Pose, Skeleton, Vec3};

/// Forward and backward displacement of a hem at a right angle of the thigh, metres.
const SWING: f64 = 0.2;
/// Outward displacement of a hem at a right angle of the hip, metres.
const FLARE: f64 = 0.1;
/// Displacement of a sleeve along the arm as the elbow's [`bend`] approaches 1, metres.
const SLIDE: f64 = 0.045;
/// Distance beyond a sleeve's end at which its slide is zero, metres.
const FADE: f64 = 0.12;
/// Bulge of a sleeve as [`bend`] approaches 1, as a share of its thickness.
const BULGE: f64 = 0.27;
/// Distance from the arm's axis at which the bulge stops growing, metres.
const BULGE_REACH: f64 = 0.1;
/// Half the length of the bulge around the elbow, metres.
const BULGE_HALF: f64 = 0.13;
/// Share of the bulge that varies with the folds.
const FOLD_DEPTH: f64 = 0.25;
/// Length of a fold along the arm, metres.
const FOLD: f64 = 0.09;
/// Width over which absolute values are rounded at 0, radians or their sines.
const ROUND: f64 = 0.1;
/// Largest excess of the slope of a garment's distance over 1, per unit of the pose's strongest movement.
/// Measured, and checked by a test.
const STRETCH: f64 = 0.45;

/// The rules that move cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Garment {
    Hem,
    Sleeve,
}

/// A person's moving clothes in the rest pose; metres.
#[derive(Clone, Debug)]
pub(crate) struct Drape {
    scale: f64,
    hem: Option<Hem>,
    sleeve: Option<Sleeve>,
}

#[derive(Clone, Debug)]
struct Hem {
    /// Height of the waist, above which nothing moves.
    top: f64,
    /// Height of the edge, which moves the most.
    bottom: f64,
    /// Distance of each leg from the body's middle.
    hip_x: f64,
    /// Thickness at the edge.
    radius: f64,
}

#[derive(Clone, Debug)]
struct Sleeve {
    shoulder_x: f64,
    /// The elbow: distance from the body's middle, height, depth.
    elbow: Vec3,
    end_x: f64,
}

impl Drape {
    /// Clothes on `skeleton`: a hem with a height and thickness, metres, and sleeves that end at `sleeves`
    /// joints along the arm (1 is the elbow, 2 the wrist). Sleeves that don't cover the elbow don't move.
    pub(crate) fn new(
        skeleton: &Skeleton,
        scale: f64,
        hem: Option<(f64, f64)>,
        sleeves: f64,
    ) -> Self {
        let at = |joint: usize| skeleton.rest[joint];
        let (elbow, wrist) = (at(joint::L_ELBOW), at(joint::L_WRIST));
        Self {
            scale,
            hem: hem.map(|(bottom, radius)| Hem {
                top: at(joint::PELVIS)[1] + 0.03 * scale,
                bottom,
                hip_x: at(joint::L_HIP)[0],
                radius,
            }),
            sleeve: (sleeves > 1.2).then(|| Sleeve {
                shoulder_x: at(joint::L_SHOULDER)[0],
                elbow,
                end_x: elbow[0] + (sleeves - 1.0) * (wrist[0] - elbow[0]),
            }),
        }
    }

    /// Whether a garment of this kind is worn.
    pub(crate) fn has(&self, garment: Garment) -> bool {
        match garment {
            Garment::Hem => self.hem.is_some(),
            Garment::Sleeve => self.sleeve.is_some(),
        }
    }

    /// The clothes in `pose`.
    pub(crate) fn posed(&self, pose: &Pose) -> Fall<'_> {
        let rotation = |joint: usize| pose.rotations[joint].map(f64::from);
        Fall {
            drape: self,
            hips: [0, 1].map(|side| Swing::of(rotation(joint::L_HIP + side))),
            elbows: [0, 1].map(|side| bend(rotation(joint::L_ELBOW + side))),
        }
    }
}

/// The movement of the hem by the thigh on its side.
#[derive(Clone, Copy, Debug)]
struct Swing {
    /// Sine of the flexion: positive for a thigh that is lifted to the front.
    forward: f64,
    /// One minus the cosine of the whole rotation.
    outward: f64,
}

impl Swing {
    /// The movement for the hip's axis-angle vector `rotation`, radians. Flexion is a rotation about -x.
    fn of(rotation: Vec3) -> Self {
        Self {
            forward: (-rotation[0]).sin(),
            outward: 1.0 - length(rotation).cos(),
        }
    }
}

/// Bend of an elbow, 0 to 1, from its axis-angle vector in radians: 0.05 at 15 degrees, 0.57 at 42, 0.83
/// at 75.
fn bend(rotation: Vec3) -> f64 {
    rounded_length(dot(rotation, rotation).sqrt()).tanh()
}

/// `|x|`, but smooth at 0.
fn rounded_length(x: f64) -> f64 {
    (x * x + ROUND * ROUND).sqrt() - ROUND
}

/// A smooth step from -1 to 1, with the value 0 and slope 1 at 0.
fn sigmoid(x: f64) -> f64 {
    x / (1.0 + x * x).sqrt()
}

/// Clothes in a pose.
#[derive(Clone, Debug)]
pub(crate) struct Fall<'a> {
    drape: &'a Drape,
    /// Left, right.
    hips: [Swing; 2],
    elbows: [f64; 2],
}

impl Fall<'_> {
    /// The offset `Δx` of a garment at a point in the rest pose, metres: the garment there equals the rest
    /// garment at `point + Δx`. 0 for a garment that is not worn.
    pub(crate) fn offset(&self, garment: Garment, point: Vec3) -> Vec3 {
        match garment {
            Garment::Hem => self.hem_offset(point),
            Garment::Sleeve => self.sleeve_offset(point),
        }
    }

    fn hem_offset(&self, [x, y, z]: Vec3) -> Vec3 {
        let Some(hem) = &self.drape.hem else {
            return [0.0; 3];
        };
        let grown = smooth_step(0.0, 1.0, (hem.top - y) / (hem.top - hem.bottom));
        let leftness = sigmoid(x / hem.hip_x);
        let shares = [0.5 + 0.5 * leftness, 0.5 - 0.5 * leftness];
        let front = sigmoid(z / hem.radius);
        let (mut forward, mut outward) = (0.0, 0.0);
        for (share, swing) in shares.into_iter().zip(self.hips) {
            // A lifted thigh moves the front of the hem, a thigh that is stretched back moves the back.
            let moved = 0.5 * (swing.forward + front * rounded_length(swing.forward));
            forward += share * moved;
            outward += share * swing.outward;
        }
        let size = grown * self.drape.scale;
        [
            -FLARE * size * outward * sigmoid(x / hem.radius),
            0.0,
            -SWING * size * forward,
        ]
    }

    fn sleeve_offset(&self, [x, y, z]: Vec3) -> Vec3 {
        let Some(sleeve) = &self.drape.sleeve else {
            return [0.0; 3];
        };
        let scale = self.drape.scale;
        let (side, bend) = if x < 0.0 {
            (-1.0, self.elbows[1])
        } else {
            (1.0, self.elbows[0])
        };
        let along = x.abs();
        let covered = smooth_step(sleeve.shoulder_x, sleeve.elbow[0], along)
            * (1.0 - smooth_step(sleeve.end_x, sleeve.end_x + FADE * scale, along));
        let slide = SLIDE * scale * bend * covered;

        let from_elbow = along - sleeve.elbow[0];
        let half = (BULGE_HALF * scale).min(sleeve.end_x - sleeve.elbow[0]);
        let inside = (1.0 - (from_elbow / half).powi(2)).max(0.0).powi(2);
        let folds = 1.0 - FOLD_DEPTH + FOLD_DEPTH * (TAU * from_elbow / (FOLD * scale)).cos();
        let off_axis = [y - sleeve.elbow[1], z - sleeve.elbow[2]];
        let reach = BULGE_REACH * scale;
        let fade = (1.0 + (off_axis[0].powi(2) + off_axis[1].powi(2)) / reach.powi(2)).sqrt();
        let bulge = BULGE * bend * inside * folds / fade;
        [side * slide, -bulge * off_axis[0], -bulge * off_axis[1]]
    }

    /// An upper bound of the offset's length for a garment, metres.
    pub(crate) fn reach(&self, garment: Garment) -> f64 {
        let scale = self.drape.scale;
        scale
            * match garment {
                Garment::Hem if self.drape.hem.is_some() => {
                    let [left, right] = self
                        .hips
                        .map(|swing| (SWING * swing.forward.abs()).hypot(FLARE * swing.outward));
                    left.max(right)
                }
                Garment::Sleeve if self.drape.sleeve.is_some() => {
                    let [left, right] = self.elbows;
                    left.max(right) * SLIDE.hypot(BULGE * BULGE_REACH)
                }
                _ => 0.0,
            }
    }

    /// An upper bound of the slope of `point + offset` by `point`; 1 for still clothes.
    pub(crate) fn stretch(&self) -> f64 {
        let mut strongest = 0.0f64;
        if self.drape.hem.is_some() {
            let [left, right] = self.hips.map(|s| s.forward.hypot(s.outward));
            strongest = left.max(right);
        }
        if self.drape.sleeve.is_some() {
            strongest = strongest.max(self.elbows[0]).max(self.elbows[1]);
        }
        1.0 + STRETCH * strongest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SyntheticPerson;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::f64::consts::FRAC_PI_2;
    use yoto_capture::skeleton::transform::{add, scale, sub};

    const GARMENTS: [Garment; 2] = [Garment::Hem, Garment::Sleeve];

    fn person() -> SyntheticPerson {
        SyntheticPerson::cast(1, 7).remove(0)
    }

    /// Points within 20 cm of the cloth.
    fn points(person: &SyntheticPerson, garment: Garment, count: usize) -> Vec<Vec3> {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let cloth: Vec<_> = (person.capsules.iter())
            .filter(|capsule| capsule.part.garment() == Some(garment))
            .collect();
        let near = |_| {
            let capsule = cloth[rng.random_range(0..cloth.len())];
            let axis = sub(capsule.to, capsule.from);
            let along = add(capsule.from, scale(axis, rng.random_range(-0.2..1.3)));
            along.map(|v| v + rng.random_range(-0.2..0.2))
        };
        (0..count).map(near).collect()
    }

    /// A pose with rotated hips and elbows, the left ones by more than the right.
    fn pose(hip: Vec3, elbow: Vec3) -> Pose {
        let mut pose = Pose::rest(24);
        for (left, rotation) in [(joint::L_HIP, hip), (joint::L_ELBOW, elbow)] {
            pose.rotations[left] = rotation.map(|v| v as f32);
            pose.rotations[left + 1] = rotation.map(|v| -0.4 * v as f32);
        }
        pose
    }

    fn strong() -> Vec<Pose> {
        let person = person();
        let mut poses = [person.motion(15), person.unseen_motion(15)].concat();
        poses.push(pose([-1.5, 0.2, 0.4], [0.3, -2.0, 0.1]));
        poses
    }

    #[test]
    fn clothes_hang_still_at_rest() {
        let person = person();
        let fall = person.drape.posed(&Pose::rest(24));
        assert_eq!(fall.stretch(), 1.0);
        for garment in GARMENTS {
            assert_eq!(fall.reach(garment), 0.0);
            for point in points(&person, garment, 200) {
                assert_eq!(length(fall.offset(garment, point)), 0.0, "{point:?}");
            }
        }
    }

    #[test]
    fn displacements_are_known_at_right_angles() {
        let person = person();
        let drape = &person.drape;
        let (hem, sleeve) = (drape.hem.as_ref(), drape.sleeve.as_ref());
        let (hem, sleeve) = (hem.expect("a skirt"), sleeve.expect("sleeves"));
        let mut pose = Pose::rest(24);
        for side in 0..2 {
            pose.rotations[joint::L_HIP + side] = [-FRAC_PI_2 as f32, 0.0, 0.0];
            pose.rotations[joint::L_ELBOW + side] = [0.0, FRAC_PI_2 as f32, 0.0];
        }
        let fall = drape.posed(&pose);
        let near = |found: Vec3, expected: Vec3| {
            let off = length(sub(found, expected));
            assert!(off < 1e-6, "{found:?} is not {expected:?}");
        };
        let s = drape.scale;
        let at_hem = |y, z| fall.offset(Garment::Hem, [0.0, y, z]);
        // 20 cm times (1 + (√1.01 - 0.1) / √2) / 2, a thickness in front of the middle.
        near(at_hem(hem.bottom, hem.radius), [0.0, 0.0, -0.163_992_8 * s]);
        near(at_hem(hem.bottom, 0.0), [0.0, 0.0, -0.1 * s]);
        near(
            at_hem((hem.top + hem.bottom) / 2.0, 0.0),
            [0.0, 0.0, -0.05 * s],
        );
        near(at_hem(hem.top, hem.radius), [0.0; 3]);
        let outward = fall.offset(Garment::Hem, [hem.radius, hem.bottom, 0.0]);
        near(outward, [-0.1 / 2.0f64.sqrt() * s, 0.0, -0.1 * s]);

        // At the elbow a sleeve has slid by 4.5 cm times tanh(√(π²/4 + 0.01) - 0.1) and is
        // 0.27 of that hyperbolic tangent thicker: 1.1 cm at a tenth of a metre's fifth.
        let [x, y, z] = sleeve.elbow;
        let bend = (FRAC_PI_2.hypot(0.1) - 0.1f64).tanh();
        let off_axis = 0.05 * s;
        let expected = [
            -0.045 * bend * s,
            0.0,
            -0.27 * bend * off_axis / 1.25f64.sqrt(),
        ];
        near(
            fall.offset(Garment::Sleeve, [-x, y, z + off_axis]),
            expected,
        );
    }

    #[test]
    fn offsets_are_smooth_and_within_their_bounds() {
        let person = person();
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut steepest = 0.0f64;
        for pose in strong() {
            let fall = person.drape.posed(&pose);
            for garment in GARMENTS {
                for point in points(&person, garment, 400) {
                    let along = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
                    let step = scale(along, 1e-4 / length(along));
                    let moved = |by: f64| {
                        let at = add(point, scale(step, by));
                        (at, fall.offset(garment, at))
                    };
                    let ((_, before), (_, here), (there, after)) =
                        (moved(-1.0), moved(0.0), moved(1.0));
                    assert!(length(here) <= fall.reach(garment) + 1e-12);
                    let bent = length(sub(add(before, after), scale(here, 2.0))) / 1e-8;
                    assert!(bent < 60.0, "{garment:?} {point:?}: {bent} 1/m");
                    let ratio = length(sub(add(there, after), add(point, here))) / 1e-4;
                    let strongest = (fall.stretch() - 1.0) / STRETCH;
                    steepest = steepest.max((ratio - 1.0) / strongest.max(1e-9));
                    assert!(ratio <= fall.stretch() + 1e-9, "{garment:?}: {ratio}");
                }
            }
        }
        assert!(steepest > 0.5 * STRETCH, "{steepest}: the bound is loose");
    }

    #[test]
    fn offsets_change_smoothly_with_the_pose() {
        let person = person();
        for garment in GARMENTS {
            for point in points(&person, garment, 50) {
                for step in -150..150 {
                    let at = |by: f64| {
                        let angle = 0.01 * (f64::from(step) + by);
                        let pose = pose([angle, 0.0, 0.0], [0.0, angle, 0.0]);
                        person.drape.posed(&pose).offset(garment, point)
                    };
                    let slope = sub(at(0.5), at(-0.5));
                    let change = length(sub(sub(at(1.5), at(0.5)), slope));
                    assert!(
                        length(slope) < 2.5e-3 && change < 2.5e-4,
                        "{step}: {slope:?}"
                    );
                }
            }
        }
    }
}
