//! Joints, boxes and images against masks, over the frames that were looked at.

use super::fit::view;
use super::observe::Observation;
use super::plan::spread;
use super::silhouette::{Grid, Thumb};
use crate::body_box::BodyView;
use crate::skeleton::Skeleton;
use yoto_proto::pose_track::PoseTrack;

/// At most this number of frames is measured.
const MOST: usize = 100;
/// Least coverage that counts as inside a mask, in a cell or one beside it: joints at the ends of limbs lie
/// close to the outline.
const NEAR: u8 = 64;
/// Worst frames named.
const NAMED: usize = 5;
/// Most area that an image over black shows, as a multiple of its mask's.
const OVER_BLACK: f64 = 1.6;
/// Least mean movement of the joints between two different poses, cells.
const MOVED: f64 = 0.3;
/// Mean difference in luma below which an image repeats the one before.
const SAME: f64 = 0.35;

/// Shares over all frames measured, with the worst frames of each.
#[derive(Clone, Debug, Default)]
pub(super) struct Agreement {
    /// Share of projected joints in the mask; `None` if no frame shows a person.
    pub joints_in_mask: Option<f64>,
    pub joints_out: Vec<u32>,
    /// Share of mask inside the projected box.
    pub mask_in_box: Option<f64>,
    pub mask_out: Vec<u32>,
    /// The masks' share of the union of masks and image content; `None` for images with a background.
    /// Black clothes over black don't lower it.
    pub image_in_mask: Option<f64>,
    /// Overlap (intersection over union) of image content and masks; `None` for images with a background.
    pub image_is_mask: Option<f64>,
    pub image_out: Vec<u32>,
}

impl Agreement {
    pub(super) fn of(track: &PoseTrack, skeleton: &Skeleton, seen: &[Observation]) -> Self {
        let grid = Grid::of(track.image_size);
        let people: Vec<&Observation> = seen.iter().filter(|it| it.shows_person()).collect();
        let people = spread(&people, MOST);
        let (mut joints, mut boxes, mut images) = (Vec::new(), Vec::new(), Vec::new());
        let mut same = Vec::new();
        for it in &people {
            let frame = &track.frames[it.position];
            let (pose, camera) = view(frame, track.image_size);
            let posed = skeleton.posed_joints(&pose);
            let inside = posed
                .iter()
                .filter_map(|&joint| grid.cell(camera.project(joint)?))
                .filter(|&cell| covered_near(&it.mask, grid, cell))
                .count();
            joints.push((frame.index, inside as f64 / posed.len().max(1) as f64));
            let small = camera.resized(grid.width as u32, grid.height as u32);
            let body_box = BodyView::new(skeleton, &pose, &small);
            let held = it.mask.cells.iter().enumerate().filter(|&(cell, &mask)| {
                let (x, y) = (cell % grid.width, cell / grid.width);
                mask > 0 && body_box.ray(x as f64 + 0.5, y as f64 + 0.5).is_some()
            });
            let held = held.map(|(_, &mask)| f64::from(mask)).sum::<f64>() / 255.0;
            boxes.push((frame.index, held / it.mask.area.max(1e-9)));
            images.push((frame.index, it.mask.share_with(&it.content)));
            same.push((frame.index, it.content.overlap_with(&it.mask)));
        }
        let mut spill: Vec<f64> = people
            .iter()
            .map(|it| it.content.area / it.mask.area.max(1e-9))
            .collect();
        spill.sort_by(f64::total_cmp);
        let over_black = spill
            .get(spill.len() / 2)
            .is_some_and(|it| *it < OVER_BLACK);
        Self {
            joints_in_mask: mean(&joints),
            joints_out: worst(joints),
            mask_in_box: mean(&boxes),
            mask_out: worst(boxes),
            image_in_mask: mean(&images).filter(|_| over_black),
            image_is_mask: mean(&same).filter(|_| over_black),
            image_out: worst(images),
        }
    }
}

fn covered_near(mask: &Thumb, grid: Grid, cell: usize) -> bool {
    let (x, y) = (cell % grid.width, cell / grid.width);
    (y.saturating_sub(1)..(y + 2).min(grid.height)).any(|y| {
        (x.saturating_sub(1)..(x + 2).min(grid.width))
            .any(|x| mask.cells[y * grid.width + x] >= NEAR)
    })
}

fn mean(values: &[(u32, f64)]) -> Option<f64> {
    let sum: f64 = values.iter().map(|(_, value)| value).sum();
    (!values.is_empty()).then(|| sum / values.len() as f64)
}

/// The frames with the lowest shares, ascending by index.
fn worst(mut values: Vec<(u32, f64)>) -> Vec<u32> {
    values.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut frames: Vec<u32> = values.iter().take(NAMED).map(|(frame, _)| *frame).collect();
    frames.sort_unstable();
    frames
}

/// Frames that repeat the one before although the pose moved, and the number of pairs of neighbours
/// compared.
pub(super) fn duplicates(
    track: &PoseTrack,
    skeleton: &Skeleton,
    seen: &[Observation],
) -> (Vec<u32>, usize) {
    let grid = Grid::of(track.image_size);
    let projected = |it: &Observation| {
        let (pose, camera) = view(&track.frames[it.position], track.image_size);
        let joints = skeleton.posed_joints(&pose).into_iter();
        joints
            .map(|joint| camera.project(joint))
            .collect::<Vec<_>>()
    };
    let (mut found, mut compared) = (Vec::new(), 0);
    for pair in seen.windows(2) {
        let [before, now] = pair else { continue };
        if now.position != before.position + 1 || !now.shows_person() || !before.shows_person() {
            continue;
        }
        compared += 1;
        let (mut difference, mut count) = (0u64, 0u64);
        let lumas = before.luma.iter().zip(&now.luma);
        let masks = before.mask.cells.iter().zip(&now.mask.cells);
        for ((&a, &b), (&m, &n)) in lumas.zip(masks) {
            if m > 0 || n > 0 {
                difference += u64::from(a.abs_diff(b));
                count += 1;
            }
        }
        let same = (difference as f64) < SAME * count as f64;
        if !same {
            continue;
        }
        let moved: Vec<f64> = projected(before)
            .iter()
            .zip(projected(now))
            .filter_map(|(a, b)| {
                let (a, b) = ((*a)?, b?);
                Some((a[0] - b[0]).hypot(a[1] - b[1]) * grid.scale)
            })
            .collect();
        if moved.iter().sum::<f64>() > MOVED * moved.len() as f64 {
            found.push(track.frames[now.position].index);
        }
    }
    (found, compared)
}
