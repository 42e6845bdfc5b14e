//! Sides of a person that no frame shows. Nothing teaches the splats there, which keep what chance gave them. Late in a run
//! ([`settle`]) and at its end they take colours from where the person was seen ([`guess`]), and a note says so.

mod guess;
mod settle;
mod sighted;

use crate::avatar::{Avatar, AvatarAppearance, AvatarSplats};
use crate::host::read;
use crate::motion::posed;
use crate::train::TrainError;
use crate::train::model::Model;
use crate::train::people::{TrainFrame, TrainSubject};
use burn::module::Module;
use guess::{Guessed, Surface};
pub(crate) use settle::{release, settle};
use sighted::sighted;
use std::cmp::Ordering;
use tracing::trace_span;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;
use yoto_ops::splat::{MIN_ALPHA, ROW};
use yoto_ops::warp::inverse::solve::Skinning;
use yoto_proto::correction::other_sides;

/// Smallest share of the surface that is worth a note, percent.
const NOTED: f64 = 2.0;

/// Guesses the colours of each person's splats that no training frame shows, in a model after the completed
/// fraction `opened` of its run, and holds them. Returns notes for people.
pub(crate) fn guess_unseen(
    model: &mut Model,
    subjects: &[TrainSubject],
    opened: f64,
) -> Result<Vec<String>, TrainError> {
    let _span = trace_span!("unseen").entered();
    let mut notes = Vec::new();
    for subject in subjects {
        let avatar = model.state.avatar().clone().no_grad();
        let splats = match avatar.appearance(&model.config) {
            AvatarAppearance::Splats(splats) if splats.config.guess_unseen => splats,
            _ => return Ok(notes),
        };
        let own = Avatar::own_slot(&model.config, subject.slot);
        // What was held did not learn: it is a guess still, even where a frame shows it by now.
        let held = avatar.held_splats(own)?;
        let guessed = guess(model, subject, splats, opened, held)?;
        let avatar = model.state.avatar_mut();
        avatar.paint_splats(own, &guessed.colours, &guessed.anew)?;
        avatar.hold_splats(own, Some(&guessed.anew))?;
        notes.extend(guessed.note(&subject.name, avatar.guessed_share(own)?));
    }
    Ok(notes)
}

/// The colours of a person's splats, with guesses where no frame shows them, or of the splats that are `held`. Splats hardly
/// move after the first guess, and to look at frames again would take as long as ten steps.
fn guess(
    model: &Model,
    subject: &TrainSubject,
    avatar: AvatarSplats<'_>,
    opened: f64,
    held: Option<Vec<bool>>,
) -> Result<Guessed, TrainError> {
    let pose = |frame: &TrainFrame| match &model.state.poses[subject.slot] {
        Some(poses) => poses.refined(frame.position, &frame.pose),
        None => frame.pose.clone(),
    };
    let seen = match held {
        Some(held) => held.into_iter().map(|held| !held).collect(),
        None => sighted(subject, avatar, opened, pose)?,
    };
    let skeleton = &subject.body.skeleton;
    let rest = Pose::rest(skeleton.joints());
    let posed = avatar.pose(&subject.body, subject.slot, &rest, opened);
    let rows = read(avatar.posed(&subject.body, &posed)?.rows())?;
    let (weights, transforms) = (
        read(posed.weights)?,
        read(posed::transforms(&subject.body, &rest))?,
    );
    let skinning = Skinning::new(&weights, &transforms, &subject.body.grid);
    let rows = rows.as_chunks::<ROW>().0;
    let strongest = |row: &[f32; ROW]| {
        let shares = skinning.skinning_weights([row[0], row[1], row[2]]);
        let most = shares.into_iter().max_by(|(_, a), (_, b)| a.total_cmp(b));
        most.map_or(0, |(bone, _)| bone)
    };
    let shown = |row: &[f32; ROW]| 1.0 / (1.0 + (-row[10]).exp()) > MIN_ALPHA;
    let other = other_sides(&subject.track.skeleton).ok();
    let surface = Surface {
        points: rows.iter().map(|row| [row[0], row[1], row[2]]).collect(),
        colours: rows.iter().map(|row| [row[11], row[12], row[13]]).collect(),
        bones: rows.iter().map(strongest).collect(),
        shown: rows.iter().map(shown).collect(),
        seen,
        axes: axes(skeleton),
        mirror: other.map(|other| guess::Mirror {
            middle: middle(skeleton, &other),
            other,
        }),
    };
    Ok(surface.guessed())
}

impl Guessed {
    /// What is guessed, which is the share `all` of the surface, for people; `None` if it is hardly anything.
    fn note(&self, name: &str, all: f64) -> Option<String> {
        let all = 100.0 * all;
        let mirrored = 100.0 * self.mirrored as f64 / self.shown.max(1) as f64;
        (all.total_cmp(&NOTED) != Ordering::Less).then(|| {
            let from = match mirrored.total_cmp(&NOTED) {
                Ordering::Less => String::from("what is seen around it"),
                _ => format!("the other side ({mirrored:.0} %) and what is seen around it"),
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
