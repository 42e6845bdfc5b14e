//! The pose track in protocol buffers, for long captures: text takes three times as many bytes.

use super::file::{FileCamera, FileFrame, FileTrack};
use super::{BINARY_FILE, NO_DISTORTION, Skeleton, violation};
use crate::v1::{self, Violation};
use prost::Message;

impl FileTrack {
    /// The track in `bytes`, with all lists of the required lengths.
    pub(super) fn from_binary(bytes: &[u8]) -> Result<Self, Vec<Violation>> {
        let unreadable = |error: prost::DecodeError| {
            let text = error.to_string();
            vec![violation("UNREADABLE", BINARY_FILE, None, "", text)]
        };
        let message = v1::PoseTrack::decode(bytes).map_err(unreadable)?;
        read(message).map_err(|violation| vec![*violation])
    }

    /// The encoding that [`Self::from_binary`] reads.
    pub(super) fn to_binary(&self) -> Vec<u8> {
        // A constant camera is written once.
        let first = self.frames.first();
        let k = first.and_then(|first| first.k);
        let k = k.filter(|k| self.frames.iter().all(|frame| frame.k.as_ref() == Some(k)));
        let e = first.and_then(|first| first.e);
        let e = e.filter(|e| self.frames.iter().all(|frame| frame.e.as_ref() == Some(e)));
        let frame = |frame: &FileFrame| v1::PoseFrame {
            index: frame.index,
            rotations: frame.pose.clone(),
            translation: frame.translation.to_vec(),
            intrinsics: flat(frame.k.filter(|_| k.is_none())),
            extrinsics: flat(frame.e.filter(|_| e.is_none())),
        };
        v1::PoseTrack {
            skeleton: Some(self.skeleton.to_proto()),
            width: self.image_size[0],
            height: self.image_size[1],
            fps: self.fps,
            pixel_centre: Some(self.pixel_centre),
            distortion: if self.distortion == NO_DISTORTION {
                Vec::new()
            } else {
                self.distortion.to_vec()
            },
            intrinsics: flat(k),
            extrinsics: flat(e),
            frames: self.frames.iter().map(frame).collect(),
        }
        .encode_to_vec()
    }
}

impl Skeleton {
    /// The message that [`Skeleton::from_proto`] reads back.
    pub fn to_proto(&self) -> v1::Skeleton {
        v1::Skeleton {
            names: self.names.clone(),
            parents: self.parents.clone(),
            rest_joints: self.rest_joints.as_flattened().to_vec(),
        }
    }

    /// The skeleton of a message, not yet checked.
    ///
    /// # Errors
    /// When the rest joints are not a whole number of positions. Boxed because it is rare.
    pub fn from_proto(message: v1::Skeleton) -> Result<Self, Box<Violation>> {
        let (rest_joints, odd) = message.rest_joints.as_chunks::<3>();
        if !odd.is_empty() {
            let field = "skeleton.rest_joints";
            return Err(length(field, None, &message.rest_joints, "3 a joint"));
        }
        Ok(Self {
            rest_joints: rest_joints.to_vec(),
            names: message.names,
            parents: message.parents,
        })
    }
}

fn read(message: v1::PoseTrack) -> Result<FileTrack, Box<Violation>> {
    let missing = || violation("MISSING", BINARY_FILE, None, "skeleton", "is missing");
    let skeleton = Skeleton::from_proto(message.skeleton.ok_or_else(missing)?)?;
    let distortion = match message.distortion[..] {
        [] => NO_DISTORTION,
        _ => exact("distortion", None, &message.distortion)?,
    };
    let camera = camera(None, &message.intrinsics, &message.extrinsics)?;
    let frame = |frame: v1::PoseFrame| {
        let at = Some(frame.index);
        let camera = self::camera(at, &frame.intrinsics, &frame.extrinsics)?;
        Ok(FileFrame {
            index: frame.index,
            pose: frame.rotations,
            translation: exact("translation", at, &frame.translation)?,
            k: camera.k,
            e: camera.e,
        })
    };
    Ok(FileTrack {
        skeleton,
        image_size: [message.width, message.height],
        fps: message.fps,
        pixel_centre: message.pixel_centre.unwrap_or(0.5),
        distortion,
        camera,
        frames: message
            .frames
            .into_iter()
            .map(frame)
            .collect::<Result<_, Box<Violation>>>()?,
    })
}

fn camera(
    frame: Option<u32>,
    intrinsics: &[f64],
    extrinsics: &[f64],
) -> Result<FileCamera, Box<Violation>> {
    let k: Option<[f64; 9]> = given("K", frame, intrinsics)?;
    let e: Option<[f64; 16]> = given("E", frame, extrinsics)?;
    Ok(FileCamera {
        k: k.map(|k| std::array::from_fn(|i| std::array::from_fn(|j| k[3 * i + j]))),
        e: e.map(|e| std::array::from_fn(|i| std::array::from_fn(|j| e[4 * i + j]))),
    })
}

fn flat<const R: usize, const C: usize>(matrix: Option<[[f64; C]; R]>) -> Vec<f64> {
    matrix.map_or(Vec::new(), |matrix| matrix.as_flattened().to_vec())
}

fn given<const N: usize>(
    field: &str,
    frame: Option<u32>,
    values: &[f64],
) -> Result<Option<[f64; N]>, Box<Violation>> {
    if values.is_empty() {
        Ok(None)
    } else {
        exact(field, frame, values).map(Some)
    }
}

fn exact<const N: usize>(
    field: &str,
    frame: Option<u32>,
    values: &[f64],
) -> Result<[f64; N], Box<Violation>> {
    values
        .try_into()
        .map_err(|_| length(field, frame, values, &N.to_string()))
}

fn length(field: &str, frame: Option<u32>, values: &[f64], needed: &str) -> Box<Violation> {
    let message = format!("{} numbers, {needed} are needed", values.len());
    Box::new(violation(
        "SIZE_MISMATCH",
        BINARY_FILE,
        frame,
        field,
        message,
    ))
}
