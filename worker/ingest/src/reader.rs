//! Assembles frames from pictures, masks and lenses.

use super::MAX_VIOLATIONS;
use super::capture::Capture;
use super::edges::Edges;
use super::failure::ReadFailure;
use super::order::Progress;
use yoto_capture::FrameImage;
use yoto_media::lens::Undistortion;
use yoto_media::source::{Source, WantedFrames, read_still};
use yoto_media::video::Ffmpeg;
use yoto_media::{MediaFault, Picture, compose, edge, mask};
use yoto_proto::media_plan::{
    Background, BackgroundSetting, MaskKind, MaskSource, MediaPlan, Pictures,
};
use yoto_proto::pose_track::{Frame, NO_DISTORTION, violation};

/// Assembles frames in ascending order.
#[derive(Debug)]
pub(super) struct Reader {
    images: Source,
    masks: Masks,
    mask_kind: MaskKind,
    background: Option<Background>,
    distortion: [f64; 5],
    undistortion: Option<Undistortion>,
    edges: Edges,
    /// Whether frames depend on earlier ones. If so, nothing can be read after a fault.
    pub(super) is_video: bool,
    /// A summary of what is read, for people.
    pub(super) notes: Vec<String>,
}

#[derive(Debug)]
enum Masks {
    Pictures(Source),
    Alpha,
    Plate { name: String, plate: Picture },
}

impl Reader {
    /// The same errors as [`Capture::reader`].
    pub(super) fn open(
        capture: &Capture,
        positions: &[usize],
        ffmpeg: &Ffmpeg,
        tell: &mut dyn FnMut(Progress),
    ) -> Result<Self, ReadFailure> {
        let Capture {
            files,
            plan,
            sources,
            track,
            limits,
            distortion,
            ..
        } = capture;
        let indices = |of: &dyn Fn(usize) -> Option<u32>| -> Vec<u32> {
            positions.iter().filter_map(|&at| of(at)).collect()
        };
        let image_indices = indices(&|at| Some(track.frames.get(at)?.index));
        let mask_indices = indices(&|at| capture.masks.get(at).copied());
        let mut open = |pictures: &Pictures, indices: &[u32]| {
            tell(Progress {
                file: pictures.path().to_owned(),
                total: indices.len(),
                ..Progress::default()
            });
            let wanted = WantedFrames {
                indices,
                fps: track.fps,
                timing: plan.timing,
                size: track.image_size,
            };
            Source::open(pictures, files, wanted, limits, ffmpeg, MAX_VIOLATIONS)
        };
        let images = open(&sources.images, &image_indices);
        let masks = sources.mask_pictures();
        let masks = masks.map(|pictures| open(&pictures, &mask_indices));
        let (images, masks) = match (images, masks.transpose()) {
            (Ok(images), Ok(masks)) => (images, masks),
            (images, masks) => {
                let faults = images.err().into_iter().chain(masks.err()).flatten();
                return Err(faults.collect::<Vec<_>>().into());
            }
        };
        let mut notes = capture.notes.clone();
        notes.extend(noted(plan, *distortion));
        notes.push(format!("images: {}, {}", sources.images, images.describe()));
        notes.extend(images.notes().iter().cloned());
        let kind = match plan.mask_kind {
            MaskKind::Coverage => "coverage",
            MaskKind::Inverted => "inverted coverage",
            MaskKind::Labels => "labels, all but 0 are the person",
        };
        let masks = match (&sources.masks, masks) {
            (MaskSource::Pictures(_), Some(masks)) => {
                let from = sources.mask_pictures();
                let from = from.map(|it| it.to_string()).unwrap_or_default();
                notes.push(format!("masks: {from}, {}, {kind}", masks.describe()));
                Masks::Pictures(masks)
            }
            (MaskSource::Plate(name), _) => {
                notes.push(format!(
                    "masks: a difference key against {name}; shadows and clothes of the \
                     background's colour fool it"
                ));
                let path = files.get(name).ok_or_else(|| {
                    ReadFailure::plan("MISSING", "masks", format!("there is no file '{name}'"))
                })?;
                let plate = read_still(path, limits);
                Masks::Plate {
                    name: name.clone(),
                    plate: plate.map_err(|error| ReadFailure::at(error, name, None))?,
                }
            }
            _ => {
                notes.push("masks: the pictures' alpha channel".into());
                Masks::Alpha
            }
        };
        Ok(Self {
            images,
            masks,
            mask_kind: plan.mask_kind,
            background: match plan.background {
                BackgroundSetting::Auto => None,
                BackgroundSetting::Black => Some(Background::Black),
                BackgroundSetting::Scene => Some(Background::Scene),
            },
            distortion: *distortion,
            undistortion: None,
            edges: Edges::Given,
            is_video: matches!(sources.images, Pictures::Video(_)),
            notes,
        })
    }

    /// Treats the masks' edges as `edges` says.
    pub(super) fn solve(&mut self, edges: Edges) {
        self.notes.extend(edges.note());
        self.edges = edges;
    }

    /// The file with the picture of frame `index`.
    pub(super) fn file_of(&self, index: u32) -> &str {
        self.images.name(index)
    }

    /// One frame over black, undistorted; its mask is that of frame `mask`.
    ///
    /// # Errors
    /// The faults of the picture and of the mask.
    pub(super) fn frame(
        &mut self,
        frame: &Frame,
        mask: u32,
        size: [u32; 2],
    ) -> Result<FrameImage, ReadFailure> {
        let (picture, mut mask) = self.filmed(frame, mask, size)?;
        let background = self.background(&picture, &mask);
        let (width, height) = (picture.width, picture.height);
        let rgb = match (&self.edges, background) {
            (Edges::Solved(known), Background::Scene) => edge::refine(picture, &mut mask, known),
            _ => compose::over_black(picture, &mask, background),
        };
        Ok(FrameImage {
            width,
            height,
            rgb,
            mask,
        })
    }

    /// One frame as it was filmed, undistorted, with its mask.
    pub(super) fn filmed(
        &mut self,
        frame: &Frame,
        mask: u32,
        size: [u32; 2],
    ) -> Result<(Picture, Vec<u8>), ReadFailure> {
        let index = frame.index;
        let name = self.images.name(index).to_owned();
        // Both are read, so that faults of both are reported.
        let picture = self
            .images
            .picture(index)
            .map_err(ReadFailure::from)
            .and_then(|picture| of_size(picture, size, &name, index));
        let mask = match &mut self.masks {
            Masks::Pictures(source) => Some(mask_of(source, mask, self.mask_kind, size)),
            Masks::Alpha | Masks::Plate { .. } => None,
        };
        let (mut picture, mut mask) = match (picture, mask) {
            (Ok(picture), Some(Ok(mask))) => (picture, mask),
            (Ok(picture), None) => {
                let mask = self.own_mask(&picture, &name, index)?;
                (picture, mask)
            }
            (Err(a), Some(Err(b))) => return Err(a.and(b)),
            (Err(failure), _) | (_, Some(Err(failure))) => return Err(failure),
        };
        if self.distortion != NO_DISTORTION {
            let coefficients = self.distortion;
            let (width, height) = (picture.width, picture.height);
            let fits = |it: &Undistortion| it.fits(width, height, frame.k, coefficients);
            if !self.undistortion.as_ref().is_some_and(fits) {
                let made = Undistortion::new(width, height, frame.k, coefficients);
                self.undistortion = Some(made);
            }
            if let Some(undistortion) = &self.undistortion {
                picture = undistortion.apply(&picture);
                mask = undistortion.apply_mask(&mask);
            }
        }
        Ok((picture, mask))
    }

    /// The mask from the picture itself.
    fn own_mask(&self, picture: &Picture, name: &str, index: u32) -> Result<Vec<u8>, ReadFailure> {
        match &self.masks {
            Masks::Plate { name, plate } => mask::difference_key(picture, plate)
                .map_err(|fault| ReadFailure::at(fault.into(), name, Some(index))),
            _ => picture.alpha.clone().ok_or_else(|| {
                let message = "the capture has no masks/, no video of masks and no picture of the \
                               clean background, and this picture has no alpha channel";
                ReadFailure::at(
                    MediaFault::new("NO_MASK", message).into(),
                    name,
                    Some(index),
                )
            }),
        }
    }

    /// The background, from the plan or else from the first frame.
    pub(super) fn background(&mut self, picture: &Picture, mask: &[u8]) -> Background {
        if let Some(known) = self.background {
            return known;
        }
        let found = match self.masks {
            // A difference key needs a scene, and a cut-out has no background.
            Masks::Alpha | Masks::Plate { .. } => Some(Background::Scene),
            Masks::Pictures(_) => compose::background(picture, mask),
        };
        let Some(found) = found else {
            return Background::Scene;
        };
        self.background = Some(found);
        self.notes.push(match found {
            Background::Black => "background: black, so colours are read as premultiplied".into(),
            Background::Scene => {
                "background: a scene, so colours are multiplied by the mask".into()
            }
        });
        found
    }
}

/// Corrections of the track and of the lens, for people.
fn noted(plan: &MediaPlan, distortion: [f64; 5]) -> Vec<String> {
    let mut notes = Vec::new();
    if !plan.correction.is_identity() {
        notes.push(format!("numbers read with {}", plan.correction));
    }
    if distortion != NO_DISTORTION {
        notes.push(format!(
            "lens distortion corrected, k1 k2 p1 p2 k3: {distortion:?}"
        ));
    }
    notes
}

fn mask_of(
    source: &mut Source,
    index: u32,
    kind: MaskKind,
    size: [u32; 2],
) -> Result<Vec<u8>, ReadFailure> {
    let name = source.name(index).to_owned();
    let mask = source.picture(index).map_err(ReadFailure::from)?;
    let mask = of_size(mask, size, &name, index)?;
    mask::from_picture(&mask, kind)
        .map_err(|fault| ReadFailure::at(fault.into(), &name, Some(index)))
}

fn of_size(
    picture: Picture,
    size: [u32; 2],
    name: &str,
    frame: u32,
) -> Result<Picture, ReadFailure> {
    let [width, height] = size;
    if (picture.width, picture.height) == (width as usize, height as usize) {
        return Ok(picture);
    }
    let message = format!(
        "{}x{} pixels, image_size says {width}x{height}",
        picture.width, picture.height
    );
    Err(ReadFailure::of(violation(
        "SIZE_MISMATCH",
        name,
        Some(frame),
        "",
        message,
    )))
}
