//! Which splats the training frames show.

use crate::avatar::AvatarSplats;
use crate::render::splats::{HostSplats, sight};
use crate::train::TrainError;
use crate::train::people::{TrainFrame, TrainSubject};
use rayon::prelude::*;
use yoto_capture::camera::Pose;
use yoto_ops::splat::probe::Probe;

/// Most frames that are looked at, evenly over the capture.
const FRAMES: usize = 60;
/// Part of a splat's footprint that some frame shows of it if it is seen at all. What is below is hidden by others in
/// every frame: its colour changes no training picture (docs/splats.md, "Sides that no frame shows").
const SHOWN: f32 = 0.1;
/// Smallest footprint that a part is taken of, pixels.
const SMALL: f32 = 1.0;

/// Whether any frame shows each splat of a person.
pub(super) fn sighted(
    subject: &TrainSubject,
    avatar: AvatarSplats<'_>,
    opened: f64,
    pose: impl Fn(&TrainFrame) -> Pose,
) -> Result<Vec<bool>, TrainError> {
    let stride = subject.frames.len().div_ceil(FRAMES).max(1);
    let mut most: Vec<f32> = Vec::new();
    for frame in subject.frames.iter().step_by(stride) {
        let pose = pose(frame);
        let posed = avatar.pose(&subject.body, subject.slot, &pose, opened);
        let splats = avatar.posed(&subject.body, &posed);
        let sight = sight(&subject.body.skeleton, &pose, &frame.camera);
        let splats = HostSplats::read(splats, &sight)?;
        let probe = Probe::new(splats.numbers(), &sight);
        let mut here = vec![0f32; probe.splats()];
        let covered = subject.picture(frame).covered;
        let parts = covered.par_iter();
        let parts: Vec<_> = parts
            .map(|pixel| probe.weights_at(*pixel as usize))
            .collect();
        for (splat, part) in parts.into_iter().flatten() {
            here[splat] += part;
        }
        most.resize(here.len(), 0.0);
        for (splat, (most, here)) in most.iter_mut().zip(here).enumerate() {
            *most = most.max(here / probe.footprint(splat).max(SMALL));
        }
    }
    Ok(most.iter().map(|part| *part > SHOWN).collect())
}
