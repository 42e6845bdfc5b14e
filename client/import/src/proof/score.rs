//! The score of a reading: the mean over frames of how well its bodies agree with masks
//! ([`silhouette`](super::silhouette)).

use super::found::{PoseEstimate, TrackedPerson};
use super::masks::Masks;
use super::numbers::Numbers;
use super::reading::Reading;
use super::rest::{Rest, posed};
use super::silhouette::{Silhouette, agreement_of};
use crate::ImportError;
use crate::clip::Clip;
use crate::pictures::read_masks;
use std::collections::HashMap;
use yoto_proto::smpl::JOINTS;

/// At most this number of frames is compared.
pub(crate) const FRAMES: usize = 24;
/// A reading must be better by this much for each assumption that differs from the documented reading.
const BETTER: f64 = 0.05;
/// Compares readings of one person with masks.
pub(crate) struct Proof<'a> {
    pub person: &'a TrackedPerson,
    pub masks: &'a Masks,
    pub numbers: Numbers,
    pub clip: &'a Clip,
    silhouettes: HashMap<usize, Option<Silhouette>>,
}

/// A reading and its figure.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Proven {
    pub reading: Reading,
    /// 0 to 1.
    pub figure: f64,
}

impl<'a> Proof<'a> {
    pub(super) fn new(
        person: &'a TrackedPerson,
        masks: &'a Masks,
        numbers: Numbers,
        clip: &'a Clip,
    ) -> Self {
        Self {
            person,
            masks,
            numbers,
            clip,
            silhouettes: HashMap::new(),
        }
    }

    /// The figure of `reading`; `None` where no frame has both a pose and a mask.
    ///
    /// # Errors
    /// When a mask can't be read or has another size.
    pub(super) fn figure(
        &mut self,
        reading: &Reading,
        rest: &Rest,
    ) -> Result<Option<f64>, ImportError> {
        let person = self.person;
        let step = person.seen.len().div_ceil(FRAMES).max(1);
        let (mut sum, mut count) = (0.0, 0.0);
        for seen in person.seen.iter().step_by(step) {
            let Some(frame) = self.numbers.frame(seen, self.clip, reading.shift) else {
                continue;
            };
            let size = self.clip.size;
            let Some(silhouette) = self.silhouette(seen, frame)? else {
                continue;
            };
            sum += agreement(seen, reading, rest, silhouette, size);
            count += 1.0;
        }
        Ok((count > 0.0).then_some(sum / count))
    }

    /// Pixels of the masks of all frames with the person, by those that were looked at.
    pub(super) fn masked(&self) -> f64 {
        let areas = self.silhouettes.values().flatten().map(Silhouette::area);
        let (count, sum) = areas.fold((0.0, 0.0), |(count, sum), area| (count + 1.0, sum + area));
        let has_mask = |seen: &&PoseEstimate| {
            let frame = self.numbers.frame(seen, self.clip, 0);
            frame.is_some_and(|frame| self.masks.of(seen, frame).is_some())
        };
        let frames = self.person.seen.iter().filter(has_mask).count();
        sum / f64::max(count, 1.0) * frames as f64
    }

    fn silhouette(
        &mut self,
        seen: &PoseEstimate,
        frame: usize,
    ) -> Result<Option<&Silhouette>, ImportError> {
        if let std::collections::hash_map::Entry::Vacant(entry) = self.silhouettes.entry(frame) {
            let silhouette = match self.masks.of(seen, frame) {
                None => None,
                Some(mask) => {
                    let image = read_masks(&[mask], self.clip.size, frame as u32)?;
                    Silhouette::new(image.as_raw(), self.clip.size)
                }
            };
            entry.insert(silhouette);
        }
        Ok(self.silhouettes.get(&frame).and_then(Option::as_ref))
    }

    /// The best of `readings`, the documented one first, with all figures; `None` without masks.
    ///
    /// # Errors
    /// The same errors as [`Self::figure`].
    pub(super) fn best(
        &mut self,
        readings: &[Reading],
        rest: &Rest,
    ) -> Result<Option<(Proven, Vec<Proven>)>, ImportError> {
        let mut all = Vec::new();
        for reading in readings {
            if let Some(figure) = self.figure(reading, rest)? {
                all.push(Proven {
                    reading: *reading,
                    figure,
                });
            }
        }
        let Some(documented) = readings.first() else {
            return Ok(None);
        };
        let worth = |it: &Proven| it.figure - BETTER * it.reading.changes(documented) as f64;
        let best = all
            .iter()
            .max_by(|a, b| worth(a).total_cmp(&worth(b)))
            .copied();
        all.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
        Ok(best.map(|best| (best, all)))
    }
}

/// The agreement of the body of one frame with its mask, 0 to 1.
fn agreement(
    seen: &PoseEstimate,
    reading: &Reading,
    rest: &Rest,
    mask: &Silhouette,
    size: [u32; 2],
) -> f64 {
    let Ok(camera) = reading.camera(seen, size) else {
        return 0.0;
    };
    let placed = reading.placed(seen, rest.pelvis(seen));
    let joints = posed(&rest.joints, &placed.pose, placed.root);
    let parents = JOINTS.iter().map(|(_, parent)| *parent);
    agreement_of(&joints, parents, &camera, mask, size)
}
