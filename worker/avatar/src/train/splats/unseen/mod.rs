//! Sides of a person that no frame shows. Nothing teaches the splats there, which keep what chance gave them. Late in a run
//! ([`update_frozen_colours`]) and at its end they take colours from where the person was seen ([`guess()`]), and a note says so.

mod freeze;
mod guess;
mod visibility;

use crate::avatar::{AvatarAppearance, AvatarSplats};
use crate::decoder::Decoder;
use crate::decoder::parts::Parts;
use crate::field::splats::{SOLID, opaque_area};
use crate::host::read;
use crate::train::TrainError;
use crate::train::model::Model;
use crate::train::people::{TrainFrame, TrainSubject};
use burn::module::Module;
pub(crate) use freeze::update_frozen_colours;
use guess::{Guessed, Surface};
use std::cmp::Ordering;
use tracing::trace_span;
use visibility::{SplatVisibility, splat_visibility};
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;
use yoto_ops::splat::{MIN_ALPHA, SplatRow, splat_rows};
use yoto_proto::correction::other_sides;

/// Smallest share of the surface that is worth a note, percent.
const NOTED: f64 = 2.0;

/// Guesses the colours of each person's splats that no training frame shows, in a model after the completed
/// fraction `schedule_progress` of its run, and freezes them. Returns notes for people.
pub(crate) fn guess_unseen(
    model: &mut Model,
    subjects: &[TrainSubject],
    prior: Option<&Decoder>,
    schedule_progress: f64,
) -> Result<Vec<String>, TrainError> {
    let _span = trace_span!("unseen").entered();
    let mut notes = Vec::new();
    for subject in subjects {
        let avatar = model.state.avatar().clone().no_grad();
        let splats = match avatar.appearance(&model.config) {
            AvatarAppearance::Splats(splats) if splats.config.guess_unseen => splats,
            AvatarAppearance::Splats(_) | AvatarAppearance::Field(_) => return Ok(notes),
        };
        let own = subject.own_slot;
        // What was frozen did not learn: it is a guess still, even where a frame shows it by now.
        let frozen = avatar.frozen_colours(own)?;
        let guessed = guess(model, subject, splats, prior, schedule_progress, frozen)?;
        let avatar = model.state.avatar_mut();
        avatar.paint_splats(own, &guessed.colours, &guessed.anew)?;
        avatar.freeze_colours(own, Some(&guessed.anew))?;
        notes.extend(guessed.note(&subject.name, avatar.guessed_share(own)?));
    }
    Ok(notes)
}

/// The colours of a person's splats, with guesses where no frame shows them, or of the splats that are `frozen`, and with what
/// is likely where frames hardly show them.
fn guess(
    model: &Model,
    subject: &TrainSubject,
    avatar: AvatarSplats<'_>,
    prior: Option<&Decoder>,
    schedule_progress: f64,
    frozen: Option<Vec<bool>>,
) -> Result<Guessed, TrainError> {
    let pose = |frame: &TrainFrame| match &model.state.poses[subject.slot] {
        Some(poses) => poses.refined(frame.position, &frame.pose),
        None => frame.pose.clone(),
    };
    let SplatVisibility { seen, evidence } =
        splat_visibility(subject, avatar, schedule_progress, pose)?;
    // What frames hardly show learns again after the first guess, and what it has at the end is right for those frames.
    let first = frozen.is_none();
    let seen = match frozen {
        Some(frozen) => frozen.into_iter().map(|frozen| !frozen).collect(),
        None => seen,
    };
    let skeleton = &subject.body.skeleton;
    let rest = Pose::rest(skeleton.joints());
    let posed = avatar.pose(&subject.body, subject.slot, &rest, schedule_progress);
    let rows = read(avatar.posed_splats(&subject.body, &posed)?.rows())?;
    let skinning = avatar.skinning_weights(&subject.body, &posed)?;
    let rows: Vec<SplatRow> = splat_rows(&rows).collect();
    let area = |row: &SplatRow| opaque_area(row.alpha(), row.deviations());
    let points: Vec<[f32; 3]> = rows.iter().map(|row| row.mean).collect();
    let bones: Vec<usize> = (0..points.len())
        .map(|i| usize::from(skinning.largest(i)))
        .collect();
    let other = other_sides(&subject.track.skeleton).ok();
    let mut surface = Surface {
        colours: rows.iter().map(|row| row.colour).collect(),
        shown: rows.iter().map(|row| row.alpha() > MIN_ALPHA).collect(),
        opaque: rows.iter().map(area).collect(),
        solid: rows.iter().map(|row| row.alpha() > SOLID).collect(),
        seen,
        drawn: first,
        evidence,
        axes: axes(skeleton),
        mirror: other.map(|other| guess::Mirror {
            middle: middle(skeleton, &other),
            other,
        }),
        parts: bones.clone(),
        points,
        expected: None,
    };
    if let (Some(decoder), Some(parts)) = (prior, Parts::of(skeleton)) {
        surface.by_parts(decoder, &parts, &bones);
    }
    Ok(surface.guessed())
}

impl Guessed {
    /// A note on the guesses, which are the share `all` of the surface, for people; `None` if they are hardly any.
    fn note(&self, name: &str, all: f64) -> Option<String> {
        let all = 100.0 * all;
        let mirrored = 100.0 * self.mirrored as f64 / self.shown.max(1) as f64;
        (all.total_cmp(&NOTED) != Ordering::Less).then(|| {
            let others = if self.decoded { ", and from what people have there" } else { "" };
            let from = match mirrored.total_cmp(&NOTED) {
                Ordering::Less => format!("what is seen around it{others}"),
                _ => format!("the other side ({mirrored:.0} %) and what is seen around it{others}"),
            };
            format!("{name}: {all:.0} % of the surface is in no frame: its colours are guessed, from {from}")
        })
    }
}

/// The unit direction of each joint's bone in the rest pose: to the mean of its children, or away from its parent.
fn axes(skeleton: &Skeleton) -> Vec<[f32; 3]> {
    let rest = &skeleton.rest;
    let axis = |joint: usize| {
        let children = (skeleton.parents.iter().zip(rest))
            .filter(|(parent, _)| **parent == Some(joint))
            .map(|(_, at)| std::array::from_fn(|a| at[a] - rest[joint][a]));
        let mut sum = children.fold([0f64; 3], |sum, it: [f64; 3]| {
            std::array::from_fn(|a| sum[a] + it[a])
        });
        if let (true, Some(parent)) = (sum == [0.0; 3], skeleton.parents[joint]) {
            sum = std::array::from_fn(|a| rest[joint][a] - rest[parent][a]);
        }
        let length = sum.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-9);
        sum.map(|v| (v / length) as f32)
    };
    (0..rest.len()).map(axis).collect()
}

/// The x coordinate of the plane that joints and their `other` sides lie about in the rest pose.
fn middle(skeleton: &Skeleton, other: &[usize]) -> f32 {
    let sum: f64 = (skeleton.rest.iter().zip(other))
        .map(|(at, other)| 0.5 * (at[0] + skeleton.rest[*other][0]))
        .sum();
    (sum / other.len().max(1) as f64) as f32
}
