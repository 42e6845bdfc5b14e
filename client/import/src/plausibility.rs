//! Finds frames that are useless or doubtful, in imports of any program.

use crate::clip::left_out;
use crate::pictures::{Mask, read_masks};
use crate::{ImportError, Imported, Pictures};
use yoto_proto::pose_track::{Frame, PoseTrack};

/// Fewest pixels of a person.
const FEWEST_PIXELS: usize = 16;
/// Largest share of a picture that a person fills.
const WHOLE: f64 = 0.98;
/// Fastest motion of a person, metres per second: a sprinter's.
const FASTEST: f64 = 12.0;
/// Least motion that is a jump: metres, and a share of the distance from the camera, which one camera finds only roughly.
const JUMP: [f64; 2] = [1.0, 0.1];
/// Narrowest and widest view of a camera that people film with, degrees across the longer side.
const VIEWS: [f64; 2] = [10.0, 130.0];
/// A note names at most this number of jumps.
const NAMED: usize = 4;

/// Leaves out frames whose masks show nobody or everything, and names jumps and an unlikely camera.
///
/// # Errors
/// A mask that can't be read.
pub(crate) fn ensure(imported: &mut Imported) -> Result<(), ImportError> {
    leave_out_empty(imported)?;
    let track = &imported.track;
    let doubts: Vec<String> = [jumps(track), camera(track)]
        .into_iter()
        .flatten()
        .collect();
    imported.notes.extend(doubts.iter().cloned());
    imported.found.doubts.extend(doubts);
    Ok(())
}

fn leave_out_empty(imported: &mut Imported) -> Result<(), ImportError> {
    let size = imported.track.image_size;
    let masks: Vec<&Vec<Mask>> = match &imported.pictures {
        Pictures::Files(files) => files.iter().map(|files| &files.masks).collect(),
        Pictures::Video { masks, .. } | Pictures::Decoded { masks, .. } => masks.iter().collect(),
        Pictures::Capture(_) => return Ok(()),
    };
    let (mut keep, mut empty, mut whole) = (Vec::new(), Vec::new(), Vec::new());
    for (frame, masks) in imported.track.frames.iter().zip(masks) {
        let (mut inside, mut all) = (FEWEST_PIXELS, usize::MAX);
        if !masks.is_empty() {
            let mask = read_masks(masks, size, frame.index)?;
            inside = mask.iter().filter(|level| **level >= 128).count();
            all = mask.len();
        }
        let is_whole = inside as f64 > WHOLE * all as f64;
        match (inside < FEWEST_PIXELS, is_whole) {
            (true, _) => empty.push(frame.index as usize),
            (_, true) => whole.push(frame.index as usize),
            _ => {}
        }
        keep.push(inside >= FEWEST_PIXELS && !is_whole);
    }
    // Without a frame that is left, the masks themselves are at fault, which the check of the capture tells.
    if !keep.contains(&true) {
        return Ok(());
    }
    let earlier = imported.notes.len();
    left_out(
        &empty,
        "anybody in the mask",
        |_| false,
        &mut imported.notes,
    );
    left_out(
        &whole,
        "a background in the mask",
        |_| false,
        &mut imported.notes,
    );
    let told = imported.notes.iter().skip(earlier).cloned();
    imported.found.doubts.extend(told);
    retain(&mut imported.track.frames, &keep);
    match &mut imported.pictures {
        Pictures::Files(files) => retain(files, &keep),
        Pictures::Video { masks, .. } | Pictures::Decoded { masks, .. } => retain(masks, &keep),
        Pictures::Capture(_) => {}
    }
    Ok(())
}

fn retain<T>(all: &mut Vec<T>, keep: &[bool]) {
    let mut keep = keep.iter();
    all.retain(|_| keep.next().copied().unwrap_or(true));
}

/// The root of a frame's body in the camera's axes, metres.
fn seen_root(track: &PoseTrack, frame: &Frame) -> [f64; 3] {
    let rest = track
        .skeleton
        .rest_joints
        .first()
        .copied()
        .unwrap_or_default();
    let root = [0, 1, 2].map(|axis| rest[axis] + frame.translation[axis]);
    [0, 1, 2].map(|row: usize| {
        let row = frame.e[row];
        row[0] * root[0] + row[1] * root[1] + row[2] * root[2] + row[3]
    })
}

/// Places where the person moves faster than people do, before the camera.
fn jumps(track: &PoseTrack) -> Option<String> {
    let mut jumps = Vec::new();
    for pair in track.frames.windows(2) {
        let [before, after] = [&pair[0], &pair[1]];
        let [a, b] = [before, after].map(|frame| seen_root(track, frame));
        let moved = [0, 1, 2].map(|axis: usize| b[axis] - a[axis]);
        let moved = moved.iter().map(|it| it * it).sum::<f64>().sqrt();
        let seconds = f64::from(after.index - before.index) / track.fps;
        let least = JUMP[0].max(JUMP[1] * a[2].abs());
        if moved > least && moved > FASTEST * seconds {
            jumps.push(format!(
                "{moved:.1} m from frame {} to {}",
                before.index, after.index
            ));
        }
    }
    let more = jumps.len().saturating_sub(NAMED);
    let named = jumps
        .iter()
        .take(NAMED)
        .cloned()
        .collect::<Vec<_>>()
        .join(", ");
    let more = if more > 0 {
        format!(", and {more} more")
    } else {
        String::new()
    };
    (!jumps.is_empty()).then(|| {
        format!("the person jumps {named}{more}: the poses there are wrong, or the clip is cut (--range leaves frames out)")
    })
}

/// A camera whose view is narrower or wider than what people film with.
fn camera(track: &PoseTrack) -> Option<String> {
    let longer = f64::from(track.image_size[0].max(track.image_size[1]));
    let mut focal: Vec<f64> = track
        .frames
        .iter()
        .map(|frame| frame.k[0][0].abs())
        .collect();
    let mut depth: Vec<f64> = track
        .frames
        .iter()
        .map(|frame| seen_root(track, frame)[2])
        .collect();
    focal.sort_by(f64::total_cmp);
    depth.sort_by(f64::total_cmp);
    let median = |of: &[f64]| of.get(of.len() / 2).copied();
    let (focal, depth) = (median(&focal)?, median(&depth)?);
    let view = 2.0 * (0.5 * longer / focal).atan().to_degrees();
    (!(VIEWS[0]..VIEWS[1]).contains(&view)).then(|| {
        format!(
            "the focal length of {focal:.0} px sees {view:.0}° of {longer:.0} px, so that the person is {depth:.0} m away: \
             phones have about {:.0} px (--focal)",
            longer
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Findings;
    use crate::track::empty_track;
    use image::{GrayImage, Luma};
    use std::sync::Arc;
    use yoto_proto::pose_track::Skeleton;

    const SIZE: u32 = 32;

    fn mask(inside: impl Fn(u32) -> bool) -> Vec<Mask> {
        let level = |x, _| Luma([if inside(x) { 255 } else { 0 }]);
        let mut png = std::io::Cursor::new(Vec::new());
        GrayImage::from_fn(SIZE, SIZE, level)
            .write_to(&mut png, image::ImageFormat::Png)
            .expect("a PNG");
        vec![Mask::Packed(Arc::from(png.into_inner()))]
    }

    /// A person 3 m away in `masks.len()` frames, who walks 2 cm per frame.
    fn imported(masks: Vec<Vec<Mask>>) -> Imported {
        let skeleton = Skeleton {
            names: vec!["pelvis".into()],
            parents: vec![-1],
            rest_joints: vec![[0.0; 3]],
        };
        let mut track = empty_track(skeleton, [SIZE, SIZE], 25.0);
        track.frames = (0..masks.len() as u32)
            .map(|index| Frame {
                index,
                pose: vec![0.0; 3],
                translation: [0.02 * f64::from(index), 0.0, 3.0],
                k: [[32.0, 0.0, 16.0], [0.0, 32.0, 16.0], [0.0, 0.0, 1.0]],
                e: [0, 1, 2, 3]
                    .map(|row| [0, 1, 2, 3].map(|column| f64::from(u8::from(row == column)))),
            })
            .collect();
        Imported {
            track,
            pictures: Pictures::Video {
                video: "clip.mp4".into(),
                masks,
            },
            available: 4,
            notes: Vec::new(),
            found: Findings::default(),
        }
    }

    fn good() -> Vec<Mask> {
        mask(|x| (10..20).contains(&x))
    }

    #[test]
    fn frames_of_black_and_white_masks_are_left_out() {
        let mut found = imported(vec![
            good(),
            mask(|_| false),
            mask(|_| true),
            good(),
            Vec::new(),
        ]);
        ensure(&mut found).expect("masks");
        let left: Vec<u32> = found.track.frames.iter().map(|frame| frame.index).collect();
        assert_eq!(left, [0, 3, 4], "a frame without a mask stays");
        assert_eq!(
            found.notes,
            [
                "left out: 1 frame without anybody in the mask (1)",
                "left out: 1 frame without a background in the mask (2)"
            ]
        );
        assert_eq!(found.found.doubts, found.notes);
        let Pictures::Video { masks, .. } = &found.pictures else {
            panic!("a video");
        };
        assert_eq!(masks.len(), 3);
    }

    #[test]
    fn jumps_are_named() {
        let mut found = imported(vec![good(), good(), good(), good()]);
        ensure(&mut found).expect("masks");
        assert_eq!(found.notes, [""; 0]);
        found.track.frames[2].translation[0] += 15.0;
        ensure(&mut found).expect("masks");
        assert_eq!(found.notes.len(), 1);
        let expected = "the person jumps 15.0 m from frame 1 to 2, 15.0 m from frame 2 to 3";
        assert!(found.notes[0].starts_with(expected), "{:?}", found.notes);
    }

    #[test]
    fn a_camera_of_a_telescope_is_named() {
        let mut found = imported(vec![good(), good()]);
        for frame in &mut found.track.frames {
            frame.k[0][0] *= 16.0;
            frame.translation[2] *= 16.0;
        }
        ensure(&mut found).expect("masks");
        let expected =
            "the focal length of 512 px sees 4° of 32 px, so that the person is 48 m away";
        assert!(found.notes[0].starts_with(expected), "{:?}", found.notes);
    }
}
