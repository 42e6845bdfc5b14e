//! Finds what the numbers of a BVH file mean before the camera, by masks.

use crate::ImportError;
use crate::clip::fault;
use crate::geometry::{Mat3, extrinsics, matmul, matvec, scale, sub, transpose};
use crate::motion::{Motion, Up};
use crate::pictures::Mask;
use crate::proof::{Focal, LEAST, MasksByFrame, agreement, said_agreement};
use crate::tools::opencv::Calibration;
use crate::track::{Camera, empty_track};
use std::collections::BTreeMap;
use std::path::Path;
use yoto_proto::pose_track::{Frame, PoseTrack};

/// A reading must agree better by this much for each assumption that differs from the documented reading.
const BETTER: f64 = 0.05;
/// An error names at most this number of readings.
const NAMED: usize = 5;
/// From axes with y up, of a camera that looks along −z, to the camera's; and of one that looks along +z.
const ALONG: [Mat3; 2] = [
    [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
    [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]],
];

/// A motion before a camera, whose axes and units are not sure.
pub(super) struct FilmedMotion<'a> {
    pub motion: &'a Motion,
    /// Metres per unit.
    pub scale: f64,
    /// The file's axis that is up.
    pub up: Up,
    /// The camera, if there are OpenCV's files.
    pub calibration: Option<&'a Calibration>,
    /// Frames of the clip that are wanted.
    pub frames: Vec<usize>,
    /// The motion's frame for a frame of the clip.
    pub number: &'a dyn Fn(usize) -> Option<usize>,
    pub size: [u32; 2],
    pub fps: f64,
    /// The user's focal length.
    pub focal: Option<f64>,
}

/// One way to read the numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reading {
    /// The second way to read the camera: extrinsics from the camera to the world; a camera that looks
    /// along +z.
    other_camera: bool,
    focal: Focal,
    /// Frames that a pose comes too early.
    shift: i64,
}

impl Reading {
    fn words(&self, body: &FilmedMotion<'_>) -> String {
        let camera = match (
            body.calibration.is_some_and(|it| it.e.is_some()),
            self.other_camera,
        ) {
            (true, false) => "the camera of extri.yml",
            (true, true) => "the camera of extri.yml read from the camera to the world",
            (false, false) => "a camera at the origin that looks along −z",
            (false, true) => "a camera at the origin that looks along +z",
        };
        let shift = match self.shift {
            0 => "",
            1 => ", each pose a frame later than its number",
            _ => ", each pose a frame earlier than its number",
        };
        format!("{camera}, {}{shift}", self.focal.words())
    }

    fn changes(&self, other: &Self) -> usize {
        usize::from(self.other_camera != other.other_camera)
            + usize::from(self.focal != other.focal)
            + usize::from(self.shift != other.shift)
    }
}

impl FilmedMotion<'_> {
    /// All readings, the documented one first.
    fn readings(&self) -> Vec<Reading> {
        let focals = match (self.focal, self.calibration) {
            (Some(focal), _) => vec![Focal::Given(focal)],
            (None, Some(_)) => vec![Focal::Own],
            (None, None) => vec![Focal::Diagonal, Focal::LongSide, Focal::Sixty],
        };
        let mut all = Vec::new();
        for focal in focals {
            for other_camera in [false, true] {
                for shift in [0, 1, -1] {
                    all.push(Reading {
                        other_camera,
                        focal,
                        shift,
                    });
                }
            }
        }
        all
    }

    fn camera(&self, reading: Reading) -> Camera {
        let size = self.size.map(f64::from);
        let own = self.calibration.map(|it| it.intrinsics);
        let middle = size.map(|side| side / 2.0 - 0.5);
        let centre = own.and_then(|own| own.centre).unwrap_or(middle);
        let [across, down] = match (reading.focal.pixels(size), own) {
            (Some(focal), _) => [focal; 2],
            (None, Some(own)) => own.focal,
            (None, None) => [size[0].max(size[1]); 2],
        };
        let k = [
            [across, 0.0, centre[0]],
            [0.0, down, centre[1]],
            [0.0, 0.0, 1.0],
        ];
        let e = match self.calibration.and_then(|it| it.e) {
            None => extrinsics(&ALONG[usize::from(reading.other_camera)], [0.0; 3]),
            Some(e) => {
                let rotation: Mat3 = std::array::from_fn(|i| std::array::from_fn(|j| e[i][j]));
                let translation = std::array::from_fn(|i| e[i][3]);
                let (rotation, translation) = match reading.other_camera {
                    false => (rotation, translation),
                    true => {
                        let back = transpose(&rotation);
                        (back, scale(matvec(&back, translation), -1.0))
                    }
                };
                // From the world whose y is up, in which the motion is read, to the file's.
                let to_file = transpose(&self.up.to_y());
                extrinsics(&matmul(&rotation, &to_file), translation)
            }
        };
        Camera::from_centres(k, e)
    }

    fn track(&self, reading: Reading) -> PoseTrack {
        let camera = self.camera(reading);
        let mut skeleton = self.motion.skeleton.clone();
        for joint in &mut skeleton.rest_joints {
            *joint = scale(*joint, self.scale);
        }
        let rest = skeleton.rest_joints.first().copied().unwrap_or_default();
        let mut track = empty_track(skeleton, self.size, self.fps);
        let frame = |index: &usize| {
            let of = usize::try_from(i64::try_from(*index).ok()? - reading.shift).ok()?;
            let pose = self.motion.frames.get((self.number)(of)?)?;
            Some(Frame {
                index: *index as u32,
                pose: pose.rotations.concat(),
                translation: sub(scale(pose.root, self.scale), rest),
                k: camera.k,
                e: camera.e,
            })
        };
        track.frames = self.frames.iter().filter_map(frame).collect();
        track
    }
}

/// The track of the reading that agrees best with masks, these masks of `all`, and a note.
///
/// # Errors
/// When none agrees.
pub(super) fn choose(
    body: &FilmedMotion<'_>,
    all: Vec<MasksByFrame>,
    at: &Path,
    notes: &mut Vec<String>,
) -> Result<(PoseTrack, Option<BTreeMap<usize, Mask>>), ImportError> {
    let readings = body.readings();
    let documented = readings[0];
    if all.is_empty() {
        notes.push(format!(
            "no masks (--masks or --matting-model): the capture has none, and nothing proves that the numbers \
             mean {}",
            documented.words(body)
        ));
        return Ok((body.track(documented), None));
    }
    let mut tried = Vec::new();
    for (which, masks) in all.iter().enumerate() {
        for reading in &readings {
            let figure = agreement(&body.track(*reading), &masks.frames, at)?;
            tried.extend(figure.map(|figure| (figure, which, *reading)));
        }
    }
    let worth = |(figure, _, reading): &(f64, usize, Reading)| {
        figure - BETTER * reading.changes(&documented) as f64
    };
    tried.sort_by(|one, other| worth(other).total_cmp(&worth(one)));
    let Some((figure, which, reading)) = tried.first().copied() else {
        let message = "no frame has both a pose and a mask: are the masks of this clip?";
        return Err(fault(at, "MISSING", message));
    };
    let percent = |figure: f64| format!("{:.0} %", 100.0 * figure);
    if figure < LEAST {
        let named = tried.iter().take(NAMED);
        let named =
            named.map(|(figure, _, it)| format!("{}: {}", it.words(body), percent(*figure)));
        let named: Vec<String> = named.collect();
        let message = format!(
            "the motion does not agree with the masks in any of {} readings: at best {}, {} are needed; tried {}. \
             Are motion and masks of this clip, and the camera's files of this camera?",
            tried.len(),
            percent(figure),
            percent(LEAST),
            named.join("; ")
        );
        return Err(fault(at, "UNPROVEN", message));
    }
    let masks = all.into_iter().nth(which);
    let words = masks.as_ref().map_or("masks", |masks| &masks.words);
    notes.push(if reading == documented {
        format!(
            "read with {}; {}",
            reading.words(body),
            said_agreement(words, figure)
        )
    } else {
        let usual = tried
            .iter()
            .find(|(_, of, it)| *of == which && *it == documented);
        format!(
            "not with {} ({}): {}; {}",
            documented.words(body),
            percent(usual.map_or(0.0, |(figure, ..)| *figure)),
            reading.words(body),
            said_agreement(words, figure)
        )
    });
    Ok((body.track(reading), masks.map(|masks| masks.frames)))
}
