//! SAM 3D Body's results, one `.npz` per frame and person, or one file of all frames: `pred_joint_coords` `[127, 3]`, the joints of
//! MHR's skeleton; `pred_cam_t` `[3]`, which is added to them, so that they are in the camera's axes,
//! metres; `focal_length`, pixels, √(W² + H²) where it is missing; and `mask` `[H, W, 1]`, if the tool was
//! given masks or made them. A name holds the frame's number, and then the person's index in that frame,
//! which does not identify the person in other frames.
//!
//! 22 of MHR's 127 joints correspond to a joint of SMPL. SMPL's hands have no counterpart.

use super::detections::{Detection, Detections, FrameDetections, OwnPose};
use super::form::{DetectorForm, RecognisedBy};
use super::mhr;
use super::series::FrameNumber;
use crate::ImportError;
use crate::geometry::{Vec3, add};
use crate::source::{Faulty, Part, Source};
use std::collections::BTreeMap;
use std::sync::Arc;
use yoto_formats::rle::RunLengths;
use yoto_pose::KeyPointSet;

/// MHR's joint for each of SMPL's.
const JOINTS: [Option<usize>; 24] = [
    Some(1),
    Some(2),
    Some(18),
    Some(35),
    Some(3),
    Some(19),
    Some(36),
    Some(4),
    Some(20),
    Some(37),
    Some(8),
    Some(24),
    Some(110),
    Some(74),
    Some(38),
    Some(113),
    Some(75),
    Some(39),
    Some(76),
    Some(40),
    Some(78),
    Some(42),
    None,
    None,
];
/// Joints inside the trunk, whose positions differ between the two skeletons.
const INNER: [usize; 7] = [0, 3, 6, 9, 12, 13, 14];
/// Confidence of these, and of the others.
const CONFIDENCE: [f64; 2] = [0.35, 0.9];
/// Nearest a body can be, metres.
const NEAREST: f64 = 0.1;

/// The detector's name in notes.
const NAME: &str = "SAM 3D Body";

pub(super) static FORM: DetectorForm = DetectorForm {
    detector: Some(NAME),
    fits: RecognisedBy::Contents(fits),
    read: |file| read(file.source, file.given, file.size),
};

/// Whether this is one of its files, or a list of people as it returns them.
fn fits(root: &Part<'_>) -> bool {
    let root = root.at(0).unwrap_or_else(|_| root.clone());
    root.find("pred_joint_coords").is_some() && root.find("pred_cam_t").is_some()
}

/// The files of the folder, of pictures of `size`; `given` is the one that the user named, if it is one: the files of its series,
/// unless it holds all frames itself. Files of other contents beside these are passed over.
fn read(source: &Source, given: Option<&str>, size: [u32; 2]) -> Result<Detections, ImportError> {
    let mut frames: BTreeMap<usize, Vec<Detection>> = BTreeMap::new();
    let (mut focals, mut faulty) = (Vec::new(), Faulty::default());
    let all = source.list("", &[".npz"])?;
    let all: Vec<&str> = all
        .iter()
        .map(|file| file.trim_start_matches('/'))
        .collect();
    let names: Vec<String> = all.iter().map(|file| cleaned(file)).collect();
    let frame_number = FrameNumber::of_most_values(names.iter().map(String::as_str));
    let files = match given {
        Some(name) if holds_all(source, name)? => vec![name],
        Some(name) => {
            let is_of_take =
                |file: &&str| frame_number.is_same_take(&cleaned(file), &cleaned(name));
            all.into_iter().filter(is_of_take).collect()
        }
        None => all,
    };
    let (mut used, mut whole) = (Vec::new(), Vec::new());
    for file in files {
        let number = frame_number.of(&cleaned(file));
        let data = match source.data(file, number.and_then(|number| u32::try_from(number).ok())) {
            Ok(data) => data,
            Err(fault) if given == Some(file) => return Err(fault),
            Err(fault) => {
                faulty.keep::<()>(Err(fault))?;
                continue;
            }
        };
        let root = data.root();
        if !fits(&root) {
            continue;
        }
        let rows = of_file(&root)?;
        match rows.iter().all(|(of_frame, _)| of_frame.is_some()) {
            true => whole.push(file.to_owned()),
            false => used.push(file.to_owned()),
        }
        for (of_frame, part) in rows {
            let Some(number) = of_frame.or(number) else {
                let message = "the file's name has no frame number, and the file has no frame_idx";
                return Err(source.fault("BAD_NAME", file, None, "", message));
            };
            let read =
                focal(&part, size).and_then(|focal| Ok((focal, person(&part, focal, size)?)));
            if let Some((focal, person)) = faulty.keep(read)? {
                focals.push(focal);
                frames.entry(number).or_default().push(person);
            }
        }
    }
    let clash = match whole.as_slice() {
        [one, other, ..] => Some([one.clone(), other.clone()]),
        _ => {
            let names: Vec<String> = used.iter().map(|file| cleaned(file)).collect();
            let clash = frame_number.clash(names.iter().map(String::as_str));
            clash.map(|clash| clash.map(|at| used.get(at).cloned().unwrap_or_default()))
        }
    };
    let frames = frames.into_iter().map(|(number, people)| FrameDetections {
        number,
        image: None,
        people,
    });
    let mut found = Detections::new(NAME, KeyPointSet::Joints24, frames.collect());
    found.first = None;
    found.clash = clash;
    found.hierarchy = Some(mhr::hierarchy());
    focals.sort_by(f64::total_cmp);
    found.focal = focals.get(focals.len() / 2).copied();
    faulty.finish(&mut found.notes)?;
    Ok(found)
}

/// A file's name without the tool's, which has a number.
fn cleaned(file: &str) -> String {
    let name = file.to_ascii_lowercase();
    name.replace("sam3d", "")
        .replace("sam_3d", "")
        .replace("sam-3d", "")
}

/// Whether the file holds all frames by itself: an `.npz` with one more axis, or a file of another format.
fn holds_all(source: &Source, name: &str) -> Result<bool, ImportError> {
    if !name.to_ascii_lowercase().ends_with(".npz") {
        return Ok(true);
    }
    let data = source.data(name, None)?;
    let coords = data.root().find("pred_joint_coords");
    let shape = coords
        .map(|part| part.unchecked())
        .transpose()?
        .map(|it| it.shape);
    Ok(shape.is_some_and(|shape| matches!(shape[..], [_, _, 3])))
}

/// The people of a file with their frames, if it has these: one person; a list of people; or, as scripts write it, all
/// frames of one person, with one more axis in each array and `frame_idx`.
fn of_file<'a>(root: &Part<'a>) -> Result<Vec<(Option<usize>, Part<'a>)>, ImportError> {
    if root.is_list() {
        return (0..root.len()?)
            .map(|at| Ok((None, root.at(at)?)))
            .collect();
    }
    let coords = root.get("pred_joint_coords")?.unchecked()?;
    let [rows, _, 3] = coords.shape[..] else {
        return Ok(vec![(None, root.clone())]);
    };
    let numbers = match root.find("frame_idx") {
        Some(part) => part.numbers(rows)?,
        None => (0..rows).collect(),
    };
    let row = |(at, number): (usize, usize)| (Some(number), root.clone().row(at));
    Ok(numbers.into_iter().enumerate().map(row).collect())
}

fn focal(root: &Part<'_>, [width, height]: [u32; 2]) -> Result<f64, ImportError> {
    let Some(part) = root.find("focal_length") else {
        return Ok(f64::from(width).hypot(f64::from(height)));
    };
    let focal = part.number()?;
    if focal > 0.0 {
        return Ok(focal);
    }
    Err(part.fault(
        "OUT_OF_RANGE",
        format!("{focal}: a focal length is above 0"),
    ))
}

/// The mask that the person was found with, if there is one: `[H, W]` or `[H, W, 1]`, above 0 inside.
fn mask(root: &Part<'_>) -> Result<Option<Arc<RunLengths>>, ImportError> {
    let Some(part) = root.find("mask").filter(|part| !part.is_nothing()) else {
        return Ok(None);
    };
    let array = part.array()?;
    let ([height, width] | [height, width, 1] | [1, height, width]) = array.shape[..] else {
        let message = format!("the shape is {:?}, [height, width] is needed", array.shape);
        return Err(part.fault("SIZE_MISMATCH", message));
    };
    let mask = RunLengths::of_pixels(height, width, &array.values)
        .map_err(|error| part.fault("UNDECODABLE", error.to_string()))?;
    Ok((mask.area() > 0).then(|| Arc::new(mask)))
}

/// The kept joints of MHR, moved by `shift` into the camera's axes.
fn own(
    root: &Part<'_>,
    joints: &[Vec3],
    shift: Vec3,
    focal: f64,
) -> Result<Option<OwnPose>, ImportError> {
    let placed = mhr::placed(root, joints)?;
    Ok(placed.map(|mut placed| {
        for position in &mut placed.positions {
            *position = add(*position, shift);
        }
        OwnPose { placed, focal }
    }))
}

fn person(root: &Part<'_>, focal: f64, size: [u32; 2]) -> Result<Detection, ImportError> {
    let coords = root.get("pred_joint_coords")?;
    let joints = coords.rows::<3>()?;
    let shift = root.get("pred_cam_t")?.fixed::<3>()?;
    // The middle as the tool counts it, from the first pixel's centre.
    let centre = size.map(|side| 0.5 * f64::from(side) + 0.5);
    let mut person = Detection {
        hands: [None, None],
        face: None,
        person: None,
        picture: Vec::new(),
        space: Vec::new(),
        mask: mask(root)?,
        own: own(root, &joints, shift, focal)?,
    };
    for (joint, index) in JOINTS.iter().enumerate() {
        let Some(index) = index else {
            person.picture.push([0.0; 3]);
            person.space.push([0.0; 3]);
            continue;
        };
        let Some(&at) = joints.get(*index) else {
            let message = format!("{} joints: MHR's skeleton has 127", joints.len());
            return Err(coords.fault("SIZE_MISMATCH", message));
        };
        let [x, y, z]: Vec3 = add(at, shift);
        if z < NEAREST {
            let message = format!("joint {index} is {z} m before the camera");
            return Err(coords.fault("OUT_OF_RANGE", message));
        }
        let sure = CONFIDENCE[usize::from(!INNER.contains(&joint))];
        let seen = [focal * x / z + centre[0], focal * y / z + centre[1], sure];
        person.picture.push(seen);
        person.space.push([x, y, z]);
    }
    Ok(person)
}
