//! Masks of a clip alone: the pose model's, a matting model's, or those given. Of several people's masks, the person's are taken.

use super::watch::Watched;
use crate::clip::{Clip, fault};
use crate::matting::MaskRequest;
use crate::pictures::{Mask, read_masks};
use crate::proof::{Masks, MasksByFrame};
use crate::{ImportError, Options};
use std::collections::BTreeMap;
use std::path::Path;
use yoto_proto::text::count;

/// Given masks are compared with the pose model's in this number of frames.
const COMPARED: usize = 8;
/// Least overlap of given masks with the pose model's: below it, they show another person.
const SAME_PERSON: f64 = 0.5;

/// The frames that have masks, with the masks of each.
pub(super) fn of(
    options: &Options,
    clip: &Clip,
    watched: Vec<Watched>,
    notes: &mut Vec<String>,
) -> Result<(Vec<Watched>, Vec<Vec<Mask>>), ImportError> {
    if let Some(path) = &options.masks {
        return given(path, clip, watched, notes);
    }
    if let Some(model) = &options.matting {
        let mut wanted = Vec::new();
        for it in &watched {
            let own = read_masks(&[Mask::Packed(it.mask.clone())], clip.size, it.index as u32)?;
            wanted.push(MaskRequest {
                frame: it.index,
                expected: Some(own.into_raw()),
            });
        }
        let made = MasksByFrame {
            words: format!("the masks of {}", model.name()),
            frames: model.masks(clip, &wanted, &options.progress, notes)?,
        };
        return made_of_the_person(made, &model.path, clip, watched, notes);
    }
    let own = watched.iter().map(|it| vec![Mask::Packed(it.mask.clone())]);
    let own = own.collect();
    notes.push(
        "the masks are the pose model's: an outline good to some pixels (--masks or --matting-model for \
         better ones)"
            .into(),
    );
    Ok((watched, own))
}

/// The masks that the model in `path` has made, if they show the person that the pose model found. A file that
/// this program's runtime computes wrongly, or wrong levels of its pictures, give spots.
fn made_of_the_person(
    made: MasksByFrame,
    path: &Path,
    clip: &Clip,
    watched: Vec<Watched>,
    notes: &mut Vec<String>,
) -> Result<(Vec<Watched>, Vec<Vec<Mask>>), ImportError> {
    let [found, needed] = [overlap(&made, clip, &watched)?, SAME_PERSON].map(|it| 100.0 * it);
    if found < needed {
        let message = format!(
            "its masks overlap the pose model's by only {found:.0} %, {needed:.0} % are needed: are the levels of its \
             pictures others (--matting-levels), or is it in 8-bit integers?"
        );
        return Err(fault(path, "MISMATCH", message));
    }
    notes.push(format!(
        "{} overlap the pose model's by {found:.0} %",
        made.words
    ));
    Ok(with(&made.frames, watched, notes))
}

/// The masks in `path` that show the person that the pose model found.
fn given(
    path: &Path,
    clip: &Clip,
    watched: Vec<Watched>,
    notes: &mut Vec<String>,
) -> Result<(Vec<Watched>, Vec<Vec<Mask>>), ImportError> {
    let mut best: Option<(f64, MasksByFrame)> = None;
    for masks in Masks::given(path, clip)?
        .into_iter()
        .filter_map(Masks::by_frame)
    {
        let overlap = overlap(&masks, clip, &watched)?;
        if best.as_ref().is_none_or(|(most, _)| overlap > *most) {
            best = Some((overlap, masks));
        }
    }
    let (overlap, masks) = best.ok_or_else(|| fault(path, "MISSING", "there are no masks"))?;
    if overlap < SAME_PERSON {
        let message = format!(
            "no masks here show the person that the pose model found: the best overlap with the model's by {:.0} %, \
             {:.0} % are needed",
            100.0 * overlap,
            100.0 * SAME_PERSON
        );
        return Err(fault(path, "MISMATCH", message));
    }
    notes.push(format!(
        "{}, which overlap the pose model's by {:.0} %",
        masks.words,
        100.0 * overlap
    ));
    Ok(with(&masks.frames, watched, notes))
}

/// The frames that have one of `masks`, with it.
fn with(
    masks: &BTreeMap<usize, Mask>,
    watched: Vec<Watched>,
    notes: &mut Vec<String>,
) -> (Vec<Watched>, Vec<Vec<Mask>>) {
    let all = watched.len();
    let masked = watched.into_iter().filter_map(|it| {
        let mask = masks.get(&it.index)?.clone();
        Some((it, vec![mask]))
    });
    let (watched, masks): (Vec<_>, Vec<_>) = masked.unzip();
    if watched.len() < all {
        let left_out = count(all - watched.len(), "frame");
        notes.push(format!("{left_out} without a mask: left out"));
    }
    (watched, masks)
}

/// How much `masks` overlap the pose model's, intersection over union, on average.
fn overlap(masks: &MasksByFrame, clip: &Clip, watched: &[Watched]) -> Result<f64, ImportError> {
    let (mut both, mut either) = (0, 0);
    for it in watched
        .iter()
        .step_by(watched.len().div_ceil(COMPARED).max(1))
    {
        let Some(mask) = masks.frames.get(&it.index) else {
            continue;
        };
        let read = |mask: Mask| read_masks(&[mask], clip.size, it.index as u32);
        let (one, other) = (read(mask.clone())?, read(Mask::Packed(it.mask.clone()))?);
        for (one, other) in one.iter().zip(other.iter()) {
            let (one, other) = (*one > 127, *other > 127);
            both += usize::from(one && other);
            either += usize::from(one || other);
        }
    }
    Ok(both as f64 / either.max(1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::watch::Scene;
    use image::GrayImage;
    use std::sync::Arc;
    use yoto_pose::FrameKeyPoints;

    const SIZE: u32 = 32;

    /// A mask of a square at `left`, as PNG.
    fn square(left: u32) -> Vec<u8> {
        let inside = |x: u32, y: u32| (left..left + 8).contains(&x) && (8..24).contains(&y);
        let level = |x, y| image::Luma([if inside(x, y) { 255 } else { 0 }]);
        let mut png = std::io::Cursor::new(Vec::new());
        let image = GrayImage::from_fn(SIZE, SIZE, level);
        let written = image.write_to(&mut png, image::ImageFormat::Png);
        written.expect("a PNG");
        png.into_inner()
    }

    /// Four frames with the person at 4, in a clip of such pictures.
    fn clip(folder: &Path) -> (Clip, Vec<Watched>) {
        std::fs::create_dir(folder.join("clip")).expect("a folder");
        for frame in 0..4 {
            let path = folder.join(format!("clip/{frame}.png"));
            std::fs::write(path, square(4)).expect("a picture");
        }
        let clip = Clip::open(&folder.join("clip"), &crate::Options::default()).expect("a clip");
        let watched = |index| Watched {
            index,
            points: FrameKeyPoints::default(),
            mask: Arc::from(square(4)),
            figure: None,
            scene: Scene::default(),
        };
        (clip, (0..4).map(watched).collect())
    }

    /// Folders of masks, one for each person, for the frames given.
    fn people(folder: &Path, people: &[(u32, &[usize])]) {
        for (left, frames) in people {
            let folder = folder.join(format!("masks/{left}"));
            std::fs::create_dir_all(&folder).expect("a folder");
            for frame in *frames {
                let path = folder.join(format!("{frame}.png"));
                std::fs::write(path, square(*left)).expect("a mask");
            }
        }
    }

    #[test]
    fn given_masks_of_the_person_are_taken() {
        let folder = tempfile::tempdir().expect("a folder");
        let (clip, watched) = clip(folder.path());
        people(folder.path(), &[(20, &[0, 1, 2, 3]), (5, &[0, 1, 3])]);
        let mut notes = Vec::new();
        let taken = given(&folder.path().join("masks"), &clip, watched, &mut notes);
        let (watched, masks) = taken.expect("masks");
        let frames: Vec<usize> = watched.iter().map(|it| it.index).collect();
        assert_eq!(frames, [0, 1, 3], "a frame without a mask is left out");
        for masks in &masks {
            let [Mask::Image(path, _)] = &masks[..] else {
                panic!("{masks:?}");
            };
            assert!(path.parent().is_some_and(|folder| folder.ends_with("5")));
        }
        assert!(notes.iter().any(|note| note.contains("78 %")), "{notes:?}");
        assert!(notes.iter().any(|note| note.contains("1 frame without")));
    }

    #[test]
    fn masks_of_another_person_are_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let (clip, watched) = clip(folder.path());
        people(folder.path(), &[(20, &[0, 1, 2, 3])]);
        let path = folder.path().join("masks");
        let taken = given(&path, &clip, watched, &mut Vec::new());
        let error = taken.err().expect("somebody else").to_string();
        assert!(error.contains("overlap"), "{error}");
    }

    #[test]
    fn made_masks_that_miss_the_person_are_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let made = |left: u32| MasksByFrame {
            words: "the masks of net.onnx".into(),
            frames: (0..4)
                .map(|frame| (frame, Mask::Packed(Arc::from(square(left)))))
                .collect(),
        };
        let (clip, watched) = clip(folder.path());
        let mut notes = Vec::new();
        let path = Path::new("net.onnx");
        let taken = made_of_the_person(made(5), path, &clip, watched, &mut notes);
        assert_eq!(taken.expect("masks").0.len(), 4);
        assert_eq!(
            notes,
            ["the masks of net.onnx overlap the pose model's by 78 %"]
        );
        let watched = (0..4).map(|index| Watched {
            index,
            points: FrameKeyPoints::default(),
            mask: Arc::from(square(4)),
            figure: None,
            scene: Scene::default(),
        });
        let taken = made_of_the_person(made(10), path, &clip, watched.collect(), &mut notes);
        let error = taken.err().expect("spots").to_string();
        assert!(error.contains("by only 14 %"), "{error}");
    }

    #[test]
    fn without_masks_the_pose_models_are_taken() {
        let folder = tempfile::tempdir().expect("a folder");
        let (clip, watched) = clip(folder.path());
        let taken = of(&Options::default(), &clip, watched, &mut Vec::new());
        let (watched, masks) = taken.expect("masks");
        assert_eq!((watched.len(), masks.len()), (4, 4));
    }
}
