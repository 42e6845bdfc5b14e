//! Which splats the training frames show.

use crate::avatar::AvatarSplats;
use crate::render::splats::{HostSplats, sight};
use crate::train::TrainError;
use crate::train::people::{TrainFrame, TrainSubject};
use rayon::prelude::*;
use yoto_capture::camera::Pose;
use yoto_ops::splat::probe::Probe;

/// Most frames that are looked at, evenly over the capture (docs/splats.md, "Sides that no frame shows").
const FRAMES: usize = 24;
/// Part of a splat's footprint that some frame shows of it if it is seen at all. What is below is hidden by others in
/// every frame: its colour changes no training picture (docs/splats.md, "Sides that no frame shows").
const SHOWN: f32 = 0.1;
/// How far behind the surface a splat still shows, metres: farther back, it shines through splats that are not quite opaque, or
/// belongs to the other side of the body.
const BEHIND: f32 = 0.03;
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
        let splats = avatar.posed(&subject.body, &posed)?;
        let sight = sight(&subject.body.skeleton, &pose, &frame.camera);
        let splats = HostSplats::read(splats, &sight)?;
        let probe = Probe::new(splats.numbers(), &sight);
        let mut here = vec![0f32; probe.splats()];
        let covered = subject.picture(frame).covered;
        let parts = covered.par_iter();
        let parts: Vec<_> = parts
            .map(|pixel| on_the_surface(&probe, *pixel as usize))
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

/// The splats at a pixel that are no farther than [`BEHIND`] behind the depth at which half of its opacity is reached, and the
/// weight T α of each.
fn on_the_surface(probe: &Probe<'_>, pixel: usize) -> Vec<(usize, f32)> {
    let mut layers = probe.weights_at(pixel);
    let half = 0.5 * layers.iter().map(|(_, weight)| weight).sum::<f32>();
    let mut sum = 0.0;
    let surface = layers.iter().find(|(_, weight)| {
        sum += weight;
        sum >= half
    });
    if let Some(depth) = surface.map(|(splat, _)| probe.depth(*splat)) {
        layers.retain(|(splat, _)| probe.depth(*splat) <= depth + BEHIND);
    }
    layers
}
