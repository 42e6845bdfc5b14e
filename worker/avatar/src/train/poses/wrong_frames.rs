//! Frames whose poses are wrong, not just imprecise: other readings of them, and how little they count.

use crate::fit::{Picture, PoseChange, PoseFitter};
use crate::train::TrainError;
use crate::train::model::Model;
use crate::train::people::{TrainFrame, TrainSubject};
use crate::train::poses::refinement::PoseRefinement;
use std::collections::BTreeMap;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::readings::{Reading, interpolate};

/// Misfit of another reading, relative to the one so far, below which it replaces it.
const CLEARLY: f64 = 0.6;
/// Frames listed by number.
const LISTED: usize = 20;

/// The reading of a training `frame` of `subject` that fits its `picture` clearly better than its refined
/// pose; `None` if none does.
pub(crate) fn other_reading(
    poses: &PoseRefinement,
    subject: &TrainSubject,
    frame: &TrainFrame,
    fitter: &PoseFitter,
    picture: &Picture,
    blur: f64,
) -> Result<Option<(Reading, Pose, PoseChange)>, TrainError> {
    let misfit = |pose: &Pose| fitter.misfit(pose, picture, blur, [0.5; 2]);
    let now = misfit(&poses.refined(frame.position, &frame.pose))?;
    let none = PoseChange::none(subject.body.skeleton.joints());
    let mut readings = vec![(Reading::Given, frame.pose.clone(), none.clone())];
    if let Some(sides) = &subject.sides {
        let others = sides.readings(&frame.pose, &frame.camera).into_iter();
        readings.extend(others.map(|(reading, pose)| (reading, pose, none.clone())));
    }
    let frames = &subject.frames;
    let read = |index: usize| {
        let found = frames.iter().find(|it| it.position == index);
        found.map(|it| poses.read(index, &it.pose))
    };
    if let Some([before, after]) = poses.fitting_around(frame.position)
        && let (Some(a), Some(b)) = (read(before), read(after))
    {
        let at = (frame.position - before) as f64 / (after - before) as f64;
        let change = poses.change_between([before, after], at);
        readings.push((Reading::Between, interpolate(&a, &b, at), change));
    }
    let mut best: Option<((Reading, Pose, PoseChange), f64)> = None;
    for (reading, pose, change) in readings {
        let least = best.as_ref().map(|(_, least)| *least);
        let enough = least
            .or(now.map(|now| CLEARLY * now))
            .unwrap_or(f64::INFINITY);
        if let Some(found) = misfit(&change.of(&pose))?.filter(|found| *found < enough) {
            best = Some(((reading, pose, change), found));
        }
    }
    Ok(best.map(|(found, _)| found))
}

/// How far given poses are off, and frames that are not trained on as they were given, for people.
pub(crate) fn doubts(model: &Model, subjects: &[TrainSubject]) -> Vec<String> {
    let mut notes = Vec::new();
    for subject in subjects {
        let Some(poses) = &model.state.poses[subject.slot] else {
            continue;
        };
        if let Some([rotation, shift]) = poses.errors(&model.config.refinement) {
            notes.push(format!(
                "{}: given poses are off by about {:.1} degrees about each axis of a joint and \
                 {:.0} mm, as far as pictures show it",
                subject.name,
                rotation.to_degrees(),
                1e3 * shift
            ));
        }
        let (mut readings, hardly) = poses.doubts();
        readings.retain(|(position, _)| !hardly.contains(position));
        let mut by_reading: BTreeMap<Reading, Vec<u32>> = BTreeMap::new();
        let index = |position: usize| subject.track.frames[position].index;
        for (position, reading) in readings {
            by_reading.entry(reading).or_default().push(index(position));
        }
        for (reading, frames) in by_reading {
            notes.push(format!(
                "{}: read {reading}: {}",
                subject.name,
                listed(&frames)
            ));
        }
        if !hardly.is_empty() {
            let frames: Vec<u32> = hardly.into_iter().map(index).collect();
            let name = &subject.name;
            let frames = listed(&frames);
            notes.push(format!(
                "{name}: hardly counted, as no reading fits: {frames}"
            ));
        }
    }
    notes
}

/// `frames 3, 4, 12`, a few of them by number.
fn listed(frames: &[u32]) -> String {
    let shown = frames.iter().take(LISTED).map(u32::to_string);
    let shown: Vec<String> = shown.collect();
    let more = frames.len().saturating_sub(LISTED);
    let more = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    let noun = if frames.len() == 1 { "frame" } else { "frames" };
    format!("{noun} {}{more}", shown.join(", "))
}

#[cfg(test)]
#[path = "wrong_frames_tests.rs"]
mod tests;
