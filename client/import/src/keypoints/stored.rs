//! Corrects key points of the stored pictures of a video: not rotated as the file declares, or with pixels that are not square.

use super::capture::of_clip;
use super::detections::Detections;
use super::picture_transform::PictureTransform;
use super::{misfit, people};
use crate::clip::{Clip, StoredPicture};
use crate::proof::Masks;
use crate::{ImportError, Options};
use std::path::Path;
use yoto_media::Orientation;

/// With this share of points inside the masks there is no doubt.
const SURE: f64 = 0.9;
/// Least gain of that share over the points as given.
const GAIN: f64 = 0.1;

/// Declarations of the file that a detector may have ignored, with words for its pictures.
fn views(stored: StoredPicture) -> Vec<(PictureTransform, &'static str)> {
    let narrow = StoredPicture {
        orientation: Orientation::AsStored,
        ..stored
    };
    let lying = StoredPicture {
        pixel: [1.0; 2],
        ..stored
    };
    let all = [
        (narrow, "with pixels that are not square"),
        (lying, "not turned"),
        (stored, "not turned, with pixels that are not square"),
    ];
    let mut views: Vec<(PictureTransform, &str)> = Vec::new();
    for (stored, words) in all {
        let seen = PictureTransform::stored(stored);
        if seen != PictureTransform::SHOWN && views.iter().all(|(other, _)| *other != seen) {
            views.push((seen, words));
        }
    }
    views
}

/// Transforms points of stored pictures to the clip as shown, if the masks of `options` leave no doubt; with a note. Without
/// masks, pixels that are not square only get a note.
///
/// # Errors
/// When the masks can't be read, or nobody is found.
pub(super) fn correct(
    found: &mut Detections,
    clip: &Clip,
    at: &Path,
    options: &Options,
) -> Result<Option<String>, ImportError> {
    let views = views(clip.stored);
    if views.is_empty() || PictureTransform::of(options) != PictureTransform::SHOWN {
        return Ok(None);
    }
    let Some(given) = &options.masks else {
        return Ok((clip.stored.pixel != [1.0; 2]).then(|| {
            "key points of a tool that took the video's pixels for square would be beside the person: only masks tell \
             (--masks)"
                .to_owned()
        }));
    };
    let person = people::choose(found, options.person.as_deref(), at, &mut Vec::new())?;
    let first = found.counting(clip).map(|counting| counting.first);
    let numbers = found.numbers(first, clip, at)?;
    let seen = of_clip(&person, &numbers, &clip.selected(options)?);
    let all = Masks::given(given, clip)?;
    let share = |seen_as: &PictureTransform| {
        all.iter().try_fold(0.0_f64, |most, masks| {
            Ok::<_, ImportError>(most.max(misfit::share(masks, clip, &seen, 0, seen_as)?))
        })
    };
    let before = share(&PictureTransform::SHOWN)?;
    let mut best: Option<(f64, PictureTransform, &str)> = None;
    for (view, words) in views {
        let inside = share(&view)?;
        if best.is_none_or(|(most, ..)| inside > most) {
            best = Some((inside, view, words));
        }
    }
    let Some((inside, view, words)) = best.filter(|(it, ..)| *it >= SURE && *it > before + GAIN)
    else {
        return Ok(None);
    };
    view.apply_back(found, clip.size);
    Ok(Some(format!(
        "the key points are those of the pictures as the file stores them, {words}: they are made those of the clip as it is shown \
         ({:.0} % lie inside the masks then, {:.0} % before)",
        100.0 * inside,
        100.0 * before
    )))
}

#[cfg(test)]
mod tests {
    use super::super::detections::{Detection, FrameDetections};
    use super::*;
    use std::path::PathBuf;
    use yoto_pose::KeyPointSet;

    fn clip(name: &str) -> Clip {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let clips = here.join("../../worker/media/tests/clips");
        Clip::open(&clips.join(name), &Options::default()).expect("a clip")
    }

    /// A mask of a quarter of the clip, not in its middle, in each frame, and points in it.
    fn person(clip: &Clip, folder: &Path) -> (PathBuf, Vec<[f64; 3]>) {
        let [width, height] = clip.size;
        let inside = |x: u32, y: u32| 2 * x >= width && 4 * y >= height && 4 * y < 3 * height;
        let masks = folder.join("masks");
        std::fs::create_dir_all(&masks).expect("a folder");
        for frame in 0..clip.frames {
            let level = |x, y| image::Luma([255 * u8::from(inside(x, y))]);
            image::GrayImage::from_fn(width, height, level)
                .save(masks.join(format!("{frame:06}.png")))
                .expect("writes");
        }
        let [width, height] = clip.size.map(f64::from);
        let spread = |at: usize| {
            let [x, y] = [at % 5, at / 5].map(|it| it as f64);
            [width * (0.55 + 0.09 * x), height * (0.3 + 0.12 * y), 1.0]
        };
        (masks, (0..17).map(spread).collect())
    }

    fn detections(clip: &Clip, points: &[[f64; 3]]) -> Detections {
        let frame = |number| FrameDetections {
            number,
            image: None,
            people: vec![Detection {
                hands: [None, None],
                face: None,
                person: None,
                picture: points.to_vec(),
                space: Vec::new(),
                mask: None,
                own: None,
            }],
        };
        let frames = (0..clip.frames).map(frame).collect();
        Detections::new("a detector", KeyPointSet::Coco17, frames)
    }

    /// The note about points that a detector saw in stored pictures, and how far they are off after it, pixels.
    fn corrected(
        name: &str,
        seen_as: impl Fn(StoredPicture) -> StoredPicture,
    ) -> (Option<String>, f64) {
        let folder = tempfile::tempdir().expect("a folder");
        let clip = clip(name);
        let (masks, points) = person(&clip, folder.path());
        let seen = PictureTransform::stored(seen_as(clip.stored));
        let size = clip.size.map(f64::from);
        // The way there is the way back of the opposite change.
        let [width, height] = seen.size(size);
        let forth = PictureTransform {
            scale: match seen.rotation {
                Some(_) => [1.0 / seen.scale[1], 1.0 / seen.scale[0]],
                None => seen.scale.map(|it| 1.0 / it),
            },
            rotation: seen.rotation.map(|rotation| match rotation {
                super::super::PointRotation::Quarter => super::super::PointRotation::ThreeQuarters,
                super::super::PointRotation::Half => super::super::PointRotation::Half,
                super::super::PointRotation::ThreeQuarters => super::super::PointRotation::Quarter,
            }),
            mirrored: false,
        };
        let stored: Vec<[f64; 3]> = points
            .iter()
            .map(|[x, y, sure]| {
                let [x, y] = forth.back([*x, *y], [width, height]);
                [x, y, *sure]
            })
            .collect();
        let mut found = detections(&clip, &stored);
        let options = Options {
            masks: Some(masks),
            ..Options::default()
        };
        let note = correct(&mut found, &clip, Path::new("points.json"), &options);
        let off = found.frames[1].people[0].picture.iter().zip(&points);
        let off = off.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]));
        (note.expect("reads"), off.fold(0.0, f64::max))
    }

    #[test]
    fn points_of_stored_pictures_become_those_of_the_clip() {
        let lying = |stored| StoredPicture {
            pixel: [1.0; 2],
            ..stored
        };
        let narrow = |stored| StoredPicture {
            orientation: Orientation::AsStored,
            ..stored
        };
        type Stores<'a> = &'a dyn Fn(StoredPicture) -> StoredPicture;
        let cases: [(&str, Stores<'_>, &str); 4] = [
            (
                "wide_pixels.mp4",
                &|it| it,
                "with pixels that are not square:",
            ),
            ("turned_right.mp4", &|it| it, "not turned:"),
            (
                "wide_pixels_turned.mp4",
                &|it| it,
                "not turned, with pixels that are not square:",
            ),
            (
                "wide_pixels_turned.mp4",
                &narrow,
                "them, with pixels that are not square:",
            ),
        ];
        for (name, stores, words) in cases {
            let (note, off) = corrected(name, stores);
            let note = note.expect(name);
            assert!(note.contains(words), "{name}: {note}");
            assert!(off < 1e-6, "{name}: {off} px");
        }
        let shown = |stored| narrow(lying(stored));
        for name in ["wide_pixels.mp4", "turned_right.mp4"] {
            let (note, off) = corrected(name, shown);
            assert_eq!((note, off), (None, 0.0), "{name}");
        }
    }

    #[test]
    fn without_masks_pixels_that_are_not_square_are_told() {
        let said = |name: &str| {
            let clip = clip(name);
            let mut found = detections(&clip, &[[1.0, 1.0, 1.0]; 17]);
            let at = Path::new("points.json");
            let note = correct(&mut found, &clip, at, &Options::default());
            note.expect("no masks")
        };
        assert!(said("wide_pixels.mp4").is_some_and(|note| note.contains("--masks")));
        assert_eq!(said("turned_right.mp4"), None);
    }
}
