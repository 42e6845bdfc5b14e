//! Masks to compare poses with and to train with: the tool's own, a folder's or a video's.
//!
//! A folder may hold pictures of coverage, pictures that give every person a colour (SAM 2's palette
//! PNGs), or a folder of pictures for every person. The one that shows the person is found by the
//! poses: see [`score`](super::score).

use super::found::{PoseEstimate, ToolOutput, TrackedPerson};
use crate::clip::{Clip, PICTURES, fault, is_video, listed, number_in, unusable};
use crate::matting::MaskRequest;
use crate::pictures::{Mask, MaskKind, are_alike, image_size, is_cut_out, read_image};
use crate::{ImportError, MattingModel, Options};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use yoto_formats::rle::RunLengths;
use yoto_media::mask::from_picture;
use yoto_proto::media_plan;

/// Most people in a folder of masks that are tried.
const MOST_LABELS: usize = 16;
/// The colours of at most this number of a folder's pictures are read.
const LOOKED_AT: usize = 8;
/// Brightest level of labels that count people: brighter ones are coverage.
const BRIGHTEST_LABEL: u8 = 32;

/// Masks of one person (or of all together).
#[derive(Clone, Debug)]
pub(crate) struct Masks {
    /// Their source, for people: `masks/00012.png and others, colour #800000`.
    pub words: String,
    from: From,
}

#[derive(Clone, Debug)]
enum From {
    /// Each pose has its own.
    Poses,
    /// By frame.
    Frames(BTreeMap<usize, Mask>),
}

impl Masks {
    /// The mask of a pose that goes to `frame`.
    pub(crate) fn of(&self, seen: &PoseEstimate, frame: usize) -> Option<Mask> {
        match &self.from {
            From::Poses => seen.mask.clone().map(Mask::Runs),
            From::Frames(masks) => masks.get(&frame).cloned(),
        }
    }

    /// Whether a mask belongs to a pose rather than to a frame.
    pub(crate) fn are_of_poses(&self) -> bool {
        matches!(self.from, From::Poses)
    }

    /// The masks by frame, if they belong to frames.
    pub(crate) fn by_frame(self) -> Option<MasksByFrame> {
        match self.from {
            From::Poses => None,
            From::Frames(frames) => Some(MasksByFrame {
                words: self.words,
                frames,
            }),
        }
    }

    /// The mask of `frame`, if masks belong to frames.
    pub(crate) fn of_frame(&self, frame: usize) -> Option<Mask> {
        match &self.from {
            From::Poses => None,
            From::Frames(masks) => masks.get(&frame).cloned(),
        }
    }

    /// All masks to choose from: the user's, else the tool's own.
    ///
    /// # Errors
    /// When `given` holds no masks.
    pub(crate) fn find(
        given: Option<&Path>,
        found: &ToolOutput,
        clip: &Clip,
    ) -> Result<Vec<Self>, ImportError> {
        match given {
            Some(path) => Self::given(path, clip),
            None => Ok(own(found)),
        }
    }

    /// All masks in `path`, a folder or a video.
    ///
    /// # Errors
    /// When `path` holds no masks.
    pub(crate) fn given(path: &Path, clip: &Clip) -> Result<Vec<Self>, ImportError> {
        match path {
            _ if path.is_dir() => folder(path, clip),
            _ if is_video(path) => Ok(vec![video(path, clip)?]),
            _ => Err(fault(
                path,
                "MISSING",
                "neither a folder of masks nor a video",
            )),
        }
    }
}

impl Masks {
    /// Masks by a matting model, for those of `frames` that the options select.
    ///
    /// # Errors
    /// When the model can't be run or finds nobody.
    pub(crate) fn made(
        model: &MattingModel,
        frames: BTreeSet<usize>,
        clip: &Clip,
        options: &Options,
        notes: &mut Vec<String>,
    ) -> Result<Self, ImportError> {
        let selected = clip.selected(options)?;
        let is_wanted = |frame: &usize| selected.binary_search(frame).is_ok();
        let wanted: Vec<MaskRequest> = frames
            .into_iter()
            .filter(is_wanted)
            .map(|frame| MaskRequest {
                frame,
                expected: None,
            })
            .collect();
        Ok(Self {
            words: format!("the masks of {}", model.name()),
            from: From::Frames(model.masks(clip, &wanted, &options.progress, notes)?),
        })
    }
}

/// Masks by frame, with their source.
pub(crate) struct MasksByFrame {
    pub words: String,
    pub frames: BTreeMap<usize, Mask>,
}

/// The masks in the tool's files.
fn own(found: &ToolOutput) -> Vec<Masks> {
    let has = |person: &TrackedPerson| person.seen.iter().any(|seen| seen.mask.is_some());
    if found.people.iter().any(has) {
        return vec![Masks {
            words: "the tool's own masks".to_owned(),
            from: From::Poses,
        }];
    }
    if found.masks.is_empty() {
        return Vec::new();
    }
    let of = |(frame, mask): &(usize, Arc<RunLengths>)| (*frame, Mask::Runs(mask.clone()));
    vec![Masks {
        words: "the tool's own masks (of all people together)".to_owned(),
        from: From::Frames(found.masks.iter().map(of).collect()),
    }]
}

fn folder(path: &Path, clip: &Clip) -> Result<Vec<Masks>, ImportError> {
    let files = listed(path, &PICTURES)?;
    if !files.is_empty() {
        return of_files(path, &files, clip);
    }
    let mut all = Vec::new();
    let entries = std::fs::read_dir(path).map_err(ImportError::file("listing", path))?;
    let mut folders = Vec::new();
    for entry in entries {
        folders.push(entry.map_err(ImportError::file("listing", path))?.path());
    }
    folders.sort();
    for inner in folders
        .iter()
        .filter(|inner| inner.is_dir())
        .take(MOST_LABELS)
    {
        let files = listed(inner, &PICTURES)?;
        if !files.is_empty() {
            all.extend(of_files(inner, &files, clip)?);
        }
    }
    if all.is_empty() {
        return Err(fault(
            path,
            "MISSING",
            "there are no masks (PNG) in this folder",
        ));
    }
    Ok(all)
}

/// Masks of the pictures in one folder: one for each colour in them, or one of coverage.
fn of_files(path: &Path, files: &[PathBuf], clip: &Clip) -> Result<Vec<Masks>, ImportError> {
    let files = by_frame(files, clip);
    let step = files.len().div_ceil(LOOKED_AT).max(1);
    let (mut colours, mut is_coverage, mut is_alpha) = (BTreeSet::new(), false, false);
    let (mut resized, mut not_labels) = (String::new(), None);
    for (frame, file) in files.iter().step_by(step) {
        let size = image_size(file, *frame as u32)?;
        if size != clip.size && are_alike(size, clip.size) {
            resized = format!(
                " (of {}x{}, made as large as the clip by the nearest pixel)",
                size[0], size[1]
            );
        }
        if is_cut_out(file, *frame as u32)? {
            is_alpha = true;
            continue;
        }
        let image = read_image(file, size, *frame as u32)?;
        let pixels = image.as_raw().as_chunks::<3>().0;
        let is_grey = pixels.iter().all(|[r, g, b]| r == g && g == b);
        let brightest = pixels.iter().flatten().max();
        if is_grey && brightest.is_some_and(|level| *level >= BRIGHTEST_LABEL) {
            is_coverage = true;
        } else {
            colours.extend(pixels.iter().filter(|pixel| **pixel != [0; 3]).copied());
        }
        if colours.len() > MOST_LABELS {
            colours.clear();
            not_labels.get_or_insert(file);
        }
    }
    if let Some(file) = not_labels.filter(|_| !is_alpha) {
        let message = format!(
            "over {MOST_LABELS} colours: a mask has one for each person, or levels of grey; is this a picture \
             of the clip?"
        );
        return Err(fault(file, "INVALID", message));
    }
    let named = path.file_name().unwrap_or_default().to_string_lossy();
    let masks = |words: String, mask: &dyn Fn(&PathBuf) -> Mask| Masks {
        words,
        from: From::Frames(
            files
                .iter()
                .map(|(frame, file)| (*frame, mask(file)))
                .collect(),
        ),
    };
    if is_alpha {
        return Ok(vec![masks(
            format!("the alpha channel of {named}{resized}"),
            &|file| Mask::Alpha(file.clone()),
        )]);
    }
    if is_coverage || colours.is_empty() {
        return Ok(vec![masks(
            format!("the masks in {named}{resized}"),
            &|file| Mask::Image(file.clone(), MaskKind::Coverage),
        )]);
    }
    let of = |[r, g, b]: &[u8; 3]| {
        masks(
            format!("the colour #{r:02x}{g:02x}{b:02x} in {named}{resized}"),
            &|file| Mask::Colour(file.clone(), [*r, *g, *b]),
        )
    };
    Ok(colours.iter().map(of).collect())
}

/// The frames of files: by the names of the clip's pictures, else in order if there are as many as
/// frames, else by the numbers in their names.
fn by_frame(files: &[PathBuf], clip: &Clip) -> BTreeMap<usize, PathBuf> {
    let name = |file: &PathBuf| {
        file.file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let named = |file: &PathBuf| clip.named(&name(file));
    let all_named = files.iter().all(|file| named(file).is_some());
    let frame = |(order, file): (usize, &PathBuf)| {
        let frame = if all_named {
            named(file)
        } else if files.len() == clip.frames {
            Some(order)
        } else {
            number_in(&name(file))
        };
        Some((frame?, file.clone()))
    };
    files.iter().enumerate().filter_map(frame).collect()
}

/// The masks of a video: its alpha channel, or its brightness.
fn video(path: &Path, clip: &Clip) -> Result<Masks, ImportError> {
    let (mut video, _) = clip.video(path)?;
    let mut masks = BTreeMap::new();
    let mut resized = String::new();
    for frame in 0..clip.frames {
        let Some(picture) = video.next(false).map_err(|error| unusable(path, error))? else {
            break;
        };
        let size = [picture.width as u32, picture.height as u32];
        if size != clip.size && are_alike(size, clip.size) {
            resized = format!(
                " (of {}x{}, made as large as the clip by the nearest pixel)",
                size[0], size[1]
            );
        } else if size != clip.size {
            let message = format!(
                "{}x{} pixels, the clip has {}x{}",
                size[0], size[1], clip.size[0], clip.size[1]
            );
            return Err(fault(path, "SIZE_MISMATCH", message));
        }
        let coverage = match picture.alpha {
            Some(alpha) => alpha,
            None => from_picture(&picture, media_plan::MaskKind::Coverage)
                .map_err(|found| unusable(path, found.in_frame(frame).into()))?,
        };
        let mut png = Vec::new();
        PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Up)
            .write_image(&coverage, size[0], size[1], ExtendedColorType::L8)
            .map_err(|error| fault(path, "UNDECODABLE", error.to_string()))?;
        masks.insert(frame, Mask::Packed(png.into()));
    }
    let named = path.file_name().unwrap_or_default().to_string_lossy();
    Ok(Masks {
        words: format!("the masks in {named}{resized}"),
        from: From::Frames(masks),
    })
}
