//! Which splats the training frames show.

use crate::avatar::AvatarSplats;
use crate::render::splats::{HostSplats, sight};
use crate::train::TrainError;
use crate::train::people::{TrainFrame, TrainSubject};
use rayon::prelude::*;
use yoto_capture::camera::Pose;
use yoto_ops::splat::cpu::SplatSlices;
use yoto_ops::splat::probe::Probe;
use yoto_ops::splat::{ROW, View};
use yoto_ops::warp::inverse::solve::apply;

/// Most frames that are looked at, evenly over the capture.
const FRAMES: usize = 60;
/// Least part of a picture's pixels that a splat has in the frame that shows most of it, as a share of what half of
/// the splats have: a splat that others hide has less.
const SHOWN: f32 = 0.2;
/// Cosine between normal and view from which on a frame shows a splat: what is seen through gaps, or at the outline from
/// behind, is not.
const FACING: f32 = 0.15;

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
        let facing = facing(&splats.numbers(), &sight);
        for (splat, part) in parts.into_iter().flatten() {
            if facing[splat] {
                here[splat] += part;
            }
        }
        most.resize(here.len(), 0.0);
        for (most, here) in most.iter_mut().zip(here) {
            *most = most.max(here);
        }
    }
    let mut known: Vec<f32> = most.iter().copied().filter(|part| *part > 0.0).collect();
    known.sort_unstable_by(f32::total_cmp);
    let usual = known.get(known.len() / 2).copied().unwrap_or(0.0);
    Ok(most.iter().map(|part| *part > SHOWN * usual).collect())
}

/// Whether each splat faces the camera.
fn facing(numbers: &SplatSlices<'_>, sight: &View) -> Vec<bool> {
    let rows = numbers.rows.as_chunks::<ROW>().0.par_iter();
    let splats = rows.zip(numbers.transforms.as_chunks::<12>().0);
    splats
        .map(|(row, transform)| {
            let normal = third_axis([row[3], row[4], row[5], row[6]]);
            let turned = turn(|r, c| transform[4 * r + c], normal);
            let position = apply(transform, [row[0], row[1], row[2]]);
            let view = turn(|r, c| sight.e[r][c], position);
            let view = std::array::from_fn(|r| view[r] + sight.e[r][3]);
            let normal = turn(|r, c| sight.e[r][c], turned);
            let scale = dot(view, view) * dot(normal, normal);
            -dot(view, normal) > FACING * scale.sqrt()
        })
        .collect()
}

/// The third axis after the turn by a quaternion of any length.
fn third_axis([w, x, y, z]: [f32; 4]) -> [f32; 3] {
    [
        2.0 * (x * z + w * y),
        2.0 * (y * z - w * x),
        w * w - x * x - y * y + z * z,
    ]
}

/// `v` times the matrix with the entries `m` of row and column.
fn turn(m: impl Fn(usize, usize) -> f32, v: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|r| (0..3).map(|c| m(r, c) * v[c]).sum())
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
