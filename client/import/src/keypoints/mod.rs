//! Files of detectors of key points, with the clip that they saw.
//!
//! One file per detector reads its files to [`Detections`](detections::Detections): people, frames and
//! points. The rest is common: which of the people ([`people`]), which frame of the clip
//! ([`detections`], [`timing`]), which mask ([`mask`]), whether the points can be those of a person in the clip ([`judge`]), and the fit of a body to the points of all frames
//! ([`capture`], by `yoto-pose`), or the detector's own skeleton ([`own_skeleton`]).
//!
//! ```text
//! detector's files → recognise → Detections → people ┐
//! clip, masks ───────────────────────────────────────┴→ capture (fit) → track
//! ```

mod alphapose;
mod capture;
mod clip_frames;
mod detections;
mod easy_vitpose;
mod form;
mod hands;
mod judge;
mod lost;
mod mask;
mod mediapipe;
mod mediapipe_json;
mod mediapipe_table;
mod mhr;
mod misfit;
mod mmpose;
mod openpose;
mod own_skeleton;
mod people;
mod picture_transform;
mod point_rotation;
mod point_set;
mod point_table;
mod recognise;
mod sam_3d_body;
mod series;
mod shapes;
mod stored;
mod timing;

pub use point_rotation::PointRotation;
pub use point_set::PointSet;
pub use recognise::key_point_detectors;
pub(crate) use recognise::{has_files, help, looked_for};

use crate::clip::{Clip, fault};
use crate::{ImportError, Imported, Options};
use picture_transform::PictureTransform;
use std::path::Path;

/// Reads a detector's files in `options.poses`, of the clip `source`, and fits a body to them.
///
/// # Errors
/// When the files are of no known detector, wrong, or of another clip; when no body fits.
pub(crate) fn read(source: &Path, options: &Options) -> Result<Imported, ImportError> {
    let Some(at) = options.poses.as_deref() else {
        let message = "key points come with the clip that they are of: yoto import CLIP --poses \
                       THESE, where CLIP is a video or a folder of pictures";
        return Err(fault(source, "MISSING", message));
    };
    let clip = Clip::open(source, options)?;
    let seen_as = PictureTransform::of(options);
    let size = seen_as.size(clip.size.map(f64::from));
    let mut detections = recognise::read(at, options.points, size.map(|side| side as u32))?;
    if let Some([one, other]) = &detections.clash
        && detections.counting(&clip).is_some()
    {
        let message = format!(
            "two takes are here, such as {one} and {other}, and have frames of the same number: give one file of the take that is \
             meant (--poses FILE)"
        );
        return Err(fault(at, "UNSUITABLE", message));
    }
    seen_as.apply_back(&mut detections, clip.size);
    let mut notes = clip_frames::fit(&mut detections, &clip);
    notes.extend(seen_as.words());
    notes.extend(stored::correct(&mut detections, &clip, at, options)?);
    lost::join(&mut detections, &clip, &mut notes)?;
    let mut imported = capture::read(&clip, &detections, at, options)?;
    imported.found.doubts.extend(notes.iter().cloned());
    imported.notes.splice(1..1, notes);
    Ok(imported)
}
