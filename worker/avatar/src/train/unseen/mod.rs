//! Sides of a person that no frame shows. Nothing teaches the splats there, which keep what chance gave them. At the
//! end of a run they take colours from where the person was seen ([`guess`]), and a note says so.

mod guess;
mod sighted;

use super::people::{TrainFrame, TrainSubject};
use super::{TrainError, Trainer};
use crate::avatar::Avatar;
use crate::motion::posed;
use crate::render::frame::read;
use burn::module::Module;
use guess::{Guessed, Surface};
use std::cmp::Ordering;
use tracing::trace_span;
use yoto_capture::camera::Pose;
use yoto_capture::skeleton::Skeleton;
use yoto_ops::splat::{MIN_ALPHA, ROW};
use yoto_ops::warp::inverse::solve::Skinning;
use yoto_proto::correction::other_sides;

/// Smallest share of the surface that is worth a note, percent.
const NOTED: f64 = 2.0;

impl Trainer {
    /// Guesses the colours of each person's splats that no training frame shows.
    pub(super) fn guess_unseen(&mut self) -> Result<(), TrainError> {
        let guesses = self
            .config
            .splats
            .as_ref()
            .is_some_and(|it| it.guess_unseen);
        if !guesses || self.options.leave_unseen {
            return Ok(());
        }
        let _span = trace_span!("unseen").entered();
        for place in 0..self.subjects.len() {
            let guessed = self.guess(&self.subjects[place])?;
            let subject = &self.subjects[place];
            let own = Avatar::own_slot(&self.config, subject.slot);
            if let Some(note) = guessed.note(&subject.name) {
                self.progress.notes.push(note);
            }
            let avatar = self.state.avatar_mut();
            avatar.paint_splats(own, &guessed.colours, &guessed.anew)?;
        }
        Ok(())
    }

    /// The colours of a person's splats, with guesses where no frame shows them.
    fn guess(&self, subject: &TrainSubject) -> Result<Guessed, TrainError> {
        let avatar = self.state.avatar().clone().no_grad();
        let pose = |frame: &TrainFrame| match &self.state.poses[subject.slot] {
            Some(poses) => poses.refined(frame.place, &frame.pose),
            None => frame.pose.clone(),
        };
        let seen = self.sighted(subject, &avatar, pose)?;
        let skeleton = &subject.body.skeleton;
        let rest = Pose::rest(skeleton.joints());
        let posed = avatar.pose(
            &self.config,
            &subject.body,
            subject.slot,
            &rest,
            self.opened(),
        );
        let splats = avatar.posed_splats(&self.config, &subject.body, &posed);
        let rows = read(splats.ok_or(TrainError::NoLoss)?.rows())?;
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
}

impl Guessed {
    /// What was guessed, for people; `None` if it was hardly anything.
    fn note(&self, name: &str) -> Option<String> {
        let share = |count: usize| 100.0 * count as f64 / self.shown.max(1) as f64;
        let (all, mirrored) = (share(self.mirrored + self.around), share(self.mirrored));
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
