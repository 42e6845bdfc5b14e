//! The visibility of splats in the training frames.

use crate::avatar::AvatarSplats;
use crate::render::splats::{HostSplats, body_view};
use crate::train::TrainError;
use crate::train::people::{TrainFrame, TrainSubject};
use rayon::prelude::*;
use yoto_capture::camera::Pose;
use yoto_ops::splat::probe::Probe;

/// Most frames that are looked at, evenly over the capture (docs/research/splats.md, "Sides that no frame shows").
const FRAMES: usize = 24;
/// Part of a splat's footprint that some frame shows of it if it is seen at all. What is below is hidden by others in
/// every frame: its colour changes no training picture (docs/research/splats.md, "Sides that no frame shows").
const SHOWN: f32 = 0.1;
/// Evidence from which a colour is firm, in frames that show the whole splat; less where no splat of the capture is shown for
/// longer than [`WELL`] times as long (docs/research/splats.md, "What people share").
const FIRM: f32 = 1.0;
const WELL: f32 = 4.0;
/// Share of the splats that are shown for less than what counts as long.
const LONG: f32 = 0.9;
/// Evidence below which a splat is not seen, as a share of what is firm.
const HARDLY: f32 = 0.3;
/// How far behind the surface a splat still shows, metres: farther back, it shines through splats that are not quite opaque, or
/// belongs to the other side of the body.
const BEHIND: f32 = 0.03;
/// Smallest footprint that a part is taken of, pixels.
const SMALL: f32 = 1.0;

/// The visibility of a person's splats in the training frames.
pub(super) struct SplatVisibility {
    /// Whether any frame shows the splat.
    pub seen: Vec<bool>,
    /// In how many frames it is shown, as a multiple of what makes its colour firm: a frame that shows a part of it counts
    /// for this part.
    pub evidence: Vec<f32>,
}

/// Computes the visibility of a person's splats in the training frames.
pub(super) fn splat_visibility(
    subject: &TrainSubject,
    avatar: AvatarSplats<'_>,
    schedule_progress: f64,
    pose: impl Fn(&TrainFrame) -> Pose,
) -> Result<SplatVisibility, TrainError> {
    let stride = subject.frames.len().div_ceil(FRAMES).max(1);
    let (mut most, mut total): (Vec<f32>, Vec<f32>) = (Vec::new(), Vec::new());
    for frame in subject.frames.iter().step_by(stride) {
        let pose = pose(frame);
        let posed = avatar.pose(&subject.body, subject.slot, &pose, schedule_progress);
        let splats = avatar.posed_splats(&subject.body, &posed)?;
        let body_view = body_view(&subject.body.skeleton, &pose, &frame.camera);
        let splats = HostSplats::read(splats, &body_view)?;
        let probe = Probe::new(splats.as_slices(), &body_view);
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
        total.resize(here.len(), 0.0);
        for (splat, here) in here.into_iter().enumerate() {
            let part = here / probe.footprint(splat).max(SMALL);
            most[splat] = most[splat].max(part);
            total[splat] += part;
        }
    }
    Ok(SplatVisibility::new(&most, total))
}

impl SplatVisibility {
    /// The visibility by the largest part that a frame shows of each splat, and the sum of these parts.
    fn new(most: &[f32], total: Vec<f32>) -> Self {
        let mut shown: Vec<f32> = total.iter().copied().filter(|part| *part > 0.0).collect();
        shown.sort_unstable_by(f32::total_cmp);
        let long = (LONG * shown.len() as f32) as usize;
        let long = shown.get(long).copied().unwrap_or(0.0);
        let firm = FIRM.min(long / WELL).max(f32::MIN_POSITIVE);
        let evidence: Vec<f32> = total.into_iter().map(|part| part / firm).collect();
        let seen = |(most, evidence): (&f32, &f32)| *most > SHOWN && *evidence > HARDLY;
        Self {
            seen: most.iter().zip(&evidence).map(seen).collect(),
            evidence,
        }
    }
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
