//! Readings of a tool's numbers: the focal length, the meaning of the translation, and the shift of frames.
//!
//! Every tool documents one reading. Converters and older versions follow others: a translation is
//! copied to where another meaning is expected, a focal length is replaced, the first frame is left out.
//! [`score`](super::score) compares the readings with masks.

use super::found::{Intrinsics, PoseEstimate};
use crate::geometry::{Vec3, add, matvec};
use crate::track::{Camera, WorldPose};

/// Sides of images of the same size differ by at most this share.
const SAME: f64 = 0.02;

/// A focal length of images of W×H pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Focal {
    /// In the file.
    Own,
    /// √(W² + H²), a view of 53° across the diagonal.
    Diagonal,
    /// max(H, W).
    LongSide,
    /// 5000/256 · max(H, W): 3°.
    Phalp,
    /// 443.4/512 · max(H, W): 60°.
    Sixty,
    /// The user's, pixels.
    Given(f64),
}

impl Focal {
    pub(crate) fn words(self) -> String {
        match self {
            Self::Own => "the file's focal length".into(),
            Self::Diagonal => "the focal length √(W²+H²)".into(),
            Self::LongSide => "the focal length max(W, H)".into(),
            Self::Phalp => "the focal length 5000/256·max(W, H)".into(),
            Self::Sixty => "the focal length of a view of 60°".into(),
            Self::Given(focal) => format!("the focal length {focal}"),
        }
    }

    /// Pixels; `None` for the file's own.
    pub(crate) fn pixels(self, [width, height]: [f64; 2]) -> Option<f64> {
        let longer = width.max(height);
        match self {
            Self::Own => None,
            Self::Diagonal => Some(width.hypot(height)),
            Self::LongSide => Some(longer),
            Self::Phalp => Some(5000.0 / 256.0 * longer),
            Self::Sixty => Some(443.4 / 512.0 * longer),
            Self::Given(focal) => Some(focal),
        }
    }
}

/// The meaning of a translation `t`, where J0 is the pelvis at rest and R turns the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Translation {
    /// SMPL's own: the body turns about the pelvis, which is at J0 + t.
    AboutPelvis,
    /// EasyMocap's Th: the body turns about the origin, the pelvis is at R J0 + t.
    AboutOrigin,
    /// The pelvis is at t.
    Pelvis,
}

impl Translation {
    const ALL: [Self; 3] = [Self::AboutPelvis, Self::AboutOrigin, Self::Pelvis];

    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::AboutPelvis => "the translation as SMPL's (about the pelvis)",
            Self::AboutOrigin => "the translation as EasyMocap's Th (about the origin)",
            Self::Pelvis => "the translation as the pelvis itself",
        }
    }
}

/// A body model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SmplVariant {
    Smpl,
    SmplX,
}

impl SmplVariant {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Smpl => "SMPL",
            Self::SmplX => "SMPL-X",
        }
    }
}

/// The documented meaning of a tool's numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Documented {
    /// The tool's name, for people.
    pub tool: &'static str,
    /// The body model whose parameters it writes.
    pub body: SmplVariant,
    pub focal: Focal,
    /// The focal length of files that should have their own and do not, if the tool documents one.
    pub focal_without_own: Option<Focal>,
    pub translation: Translation,
}

/// One way to read a tool's numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reading {
    pub focal: Focal,
    pub translation: Translation,
    /// Frames that a pose comes too early.
    pub shift: i64,
}

impl Reading {
    /// The reading that a tool documents; `given` is the user's focal length.
    pub(crate) fn documented(
        tool: &Documented,
        seen: Option<&PoseEstimate>,
        given: Option<f64>,
    ) -> Self {
        let has_own = seen.is_some_and(|seen| seen.intrinsics.is_some());
        let focal = match (tool.focal, tool.focal_without_own, given) {
            (Focal::Own, ..) if has_own => Focal::Own,
            (Focal::Own, Some(focal), _) => focal,
            (Focal::Own, None, Some(focal)) => Focal::Given(focal),
            (Focal::Own, None, None) => Focal::LongSide,
            (focal, ..) => focal,
        };
        Self {
            focal,
            translation: tool.translation,
            shift: 0,
        }
    }

    /// This reading, and all with other assumptions; with other frames if `shifts`.
    pub(crate) fn others(self, has_own: bool, shifts: bool) -> Vec<Self> {
        let mut focals = vec![self.focal];
        let known = [Focal::Diagonal, Focal::LongSide, Focal::Phalp, Focal::Sixty];
        focals.extend(has_own.then_some(Focal::Own).into_iter().chain(known));
        let mut all = vec![self];
        let shifts: &[i64] = if shifts { &[0, 1, -1] } else { &[0] };
        for &focal in &focals {
            for translation in Translation::ALL {
                for &shift in shifts {
                    let reading = Self {
                        focal,
                        translation,
                        shift,
                    };
                    if !all.contains(&reading) {
                        all.push(reading);
                    }
                }
            }
        }
        all
    }

    /// The number of assumptions that differ from those of `other`.
    pub(crate) fn changes(&self, other: &Self) -> usize {
        usize::from(self.focal != other.focal)
            + usize::from(self.translation != other.translation)
            + usize::from(self.shift != other.shift)
    }

    pub(crate) fn words(&self) -> String {
        let shift = match self.shift {
            0 => String::new(),
            1 => ", each pose a frame later than its number".to_owned(),
            -1 => ", each pose a frame earlier than its number".to_owned(),
            by => format!(", poses moved by {by} frames"),
        };
        format!(
            "{}, {}{shift}",
            self.focal.words(),
            self.translation.words()
        )
    }

    /// The body of `seen`, whose pelvis at rest is `pelvis`.
    pub(crate) fn placed(&self, seen: &PoseEstimate, pelvis: Vec3) -> WorldPose {
        let root = match self.translation {
            Translation::AboutPelvis => add(pelvis, seen.t),
            Translation::AboutOrigin => add(matvec(&seen.root(), pelvis), seen.t),
            Translation::Pelvis => seen.t,
        };
        WorldPose {
            pose: seen.pose,
            root,
        }
    }

    /// The camera of `seen` for a clip of `size`; an error if the file's is of other images.
    pub(crate) fn camera(&self, seen: &PoseEstimate, size: [u32; 2]) -> Result<Camera, String> {
        let size = size.map(f64::from);
        let middle = size.map(|side| side / 2.0);
        let (focal, centre) = match (self.focal.pixels(size), &seen.intrinsics) {
            (Some(focal), _) => ([focal; 2], middle),
            (None, Some(own)) => scaled(own, size)?,
            (None, None) => return Err("the frame has no camera".to_owned()),
        };
        let k = [
            [focal[0], 0.0, centre[0]],
            [0.0, focal[1], centre[1]],
            [0.0, 0.0, 1.0],
        ];
        Ok(Camera::from_centres(k, seen.e.unwrap_or(IDENTITY)))
    }
}

const IDENTITY: [[f64; 4]; 4] = [
    [1.0, 0.0, 0.0, 0.0],
    [0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
];

/// Focal lengths and principal point of images of the clip's size.
fn scaled(own: &Intrinsics, size: [f64; 2]) -> Result<([f64; 2], [f64; 2]), String> {
    let middle = size.map(|side| side / 2.0);
    let centre = own.centre.unwrap_or(middle);
    let Some(of) = own.size else {
        return Ok((own.focal, centre));
    };
    // Margins are whole pixels, as wide on both sides as can be.
    let whole = size.map(|side| (side * (1.0 + own.margin.max(0.0))).round());
    let before = [0, 1].map(|axis: usize| ((whole[axis] - size[axis]) / 2.0).floor());
    match ratio(of, whole) {
        Some(ratio) => Ok((
            own.focal.map(|v| v * ratio),
            [centre[0] * ratio - before[0], centre[1] * ratio - before[1]],
        )),
        None => Err(format!(
            "the camera is of images of {:.0}x{:.0}, the clip has {:.0}x{:.0}: was it cut or turned?",
            of[0], of[1], size[0], size[1]
        )),
    }
}

/// The ratio of the image sizes `size` and `of`; `None` if their aspect ratios differ.
pub(crate) fn ratio(of: [f64; 2], size: [f64; 2]) -> Option<f64> {
    let [across, down] = [size[0] / of[0], size[1] / of[1]];
    if (across / down - 1.0).abs() > SAME || !across.is_finite() {
        return None;
    }
    let ratio = (across + down) / 2.0;
    Some(if (ratio - 1.0).abs() < SAME {
        1.0
    } else {
        ratio
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHAM: Documented = Documented {
        tool: "WHAM",
        body: SmplVariant::Smpl,
        focal: Focal::Diagonal,
        focal_without_own: None,
        translation: Translation::AboutPelvis,
    };

    #[test]
    fn cameras_of_smaller_images_grow_and_of_turned_ones_are_refused() {
        assert_eq!(ratio([719.0, 1280.0], [720.0, 1280.0]), Some(1.0));
        assert_eq!(
            ratio([504.0, 896.0], [1080.0, 1920.0]),
            Some(1080.0 / 504.0)
        );
        assert_eq!(ratio([1920.0, 1080.0], [1080.0, 1920.0]), None);
        assert_eq!(ratio([0.0, 1080.0], [1080.0, 1920.0]), None);
    }

    #[test]
    fn the_documented_reading_comes_first_and_others_count_their_changes() {
        let reading = Reading::documented(&WHAM, None, None);
        let all = reading.others(false, true);
        assert_eq!((all.len(), all[0]), (4 * 3 * 3, reading));
        let most = all.iter().map(|other| other.changes(&reading)).max();
        assert_eq!(most, Some(3));
    }
}
