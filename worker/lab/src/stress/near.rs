//! Hands and faces from near, in gestures and expressions: the film of a person with fingers and a face has none of these alone.

use super::{StressOptions, picture, sheet};
use crate::actor::Actor;
use crate::actor::gestures::{EXPRESSIONS, GESTURES, close, express};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use yoto_avatar::render::Renderer;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::smpl::{WITH_FACE, WITH_FINGERS};
use yoto_capture::skeleton::transform::{add, scale};

/// Distance of the camera from the hand or face, and height of the view there, metres.
const DISTANCE: f64 = 1.0;
const VIEW: f64 = 0.4;
/// Directions of the cameras from the hand: from before the person, and from before and above.
const FROM: [[f64; 3]; 2] = [[0.0, 0.0, 1.0], [0.0, 0.8, 0.6]];
/// Wrists, and the first joints of the middle fingers.
const HANDS: [[usize; 2]; 2] = [[20, 27], [21, 42]];
/// Directions of the cameras from the face: from before, and from before and the left.
const FACE_FROM: [[f64; 3]; 2] = [[0.0, 0.0, 1.0], [0.5, 0.0, 0.87]];
/// Jaw and left and right eye.
const FACE: [usize; 3] = [54, 55, 56];

/// Mean PSNR in the box around the person in pictures from near, dB, by gesture or expression.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Near(pub BTreeMap<String, f64>);

impl Near {
    /// The mean over gestures, dB; `None` if nothing was looked at.
    pub fn mean(&self) -> Option<f64> {
        let sum: f64 = self.0.values().sum();
        (!self.0.is_empty()).then(|| sum / self.0.len() as f64)
    }
}

/// A person to look at from near.
pub(super) struct Closeup<'a> {
    pub renderer: &'a Renderer,
    pub slot: usize,
    pub actor: &'a Actor,
    pub options: &'a StressOptions,
}

impl Closeup<'_> {
    /// The hands of the person, who stands with the arms out, and a sheet of them; nothing if the person has no fingers.
    pub(super) fn hands(&self) -> anyhow::Result<Near> {
        let joints = self.actor.skeleton.joints();
        if joints < WITH_FINGERS {
            return Ok(Near::default());
        }
        let poses = GESTURES.map(|(name, fingers)| {
            let mut pose = Pose::rest(joints);
            close(&mut pose, |finger| fingers[finger]);
            (name, pose)
        });
        self.measure(&poses, &HANDS.map(|hand| hand.to_vec()), FROM, "hands")
    }

    /// The face of the person, and a sheet of it; nothing if the person has none.
    pub(super) fn face(&self) -> anyhow::Result<Near> {
        let joints = self.actor.skeleton.joints();
        if joints < WITH_FACE {
            return Ok(Near::default());
        }
        let poses = EXPRESSIONS.map(|(name, expression)| {
            let mut pose = Pose::rest(joints);
            express(&mut pose, expression);
            (name, pose)
        });
        self.measure(&poses, &[FACE.to_vec()], FACE_FROM, "face")
    }

    /// The person in `poses`, each of the `places`, which are means of joints, from all directions; the sheet is named after `what`.
    fn measure(
        &self,
        poses: &[(&'static str, Pose)],
        places: &[Vec<usize>],
        from: [[f64; 3]; 2],
        what: &str,
    ) -> anyhow::Result<Near> {
        let Self {
            renderer,
            slot,
            actor,
            options,
        } = *self;
        let (mut near, mut cells) = (Near::default(), Vec::new());
        for (name, pose) in poses {
            let joints = actor.skeleton.posed_joints(pose);
            let mut sum = Vec::new();
            for place in places {
                let at = place.iter().fold([0.0; 3], |sum, it| add(sum, joints[*it]));
                let target = scale(at, 1.0 / place.len() as f64);
                for from in from {
                    let eye = add(target, scale(from, DISTANCE));
                    let focal = f64::from(options.size) * DISTANCE / VIEW;
                    let size = options.size;
                    let camera = Camera::look_at(eye, target, [0.0, 1.0, 0.0], focal, size, size);
                    let (figures, cell) =
                        picture(renderer, slot, actor, (name, pose), (0.0, &camera))?;
                    sum.extend(figures.map(|it| it.psnr));
                    cells.push(cell);
                }
            }
            let mean = sum.iter().sum::<f64>() / sum.len().max(1) as f64;
            near.0.insert((*name).to_owned(), mean);
        }
        let path = options.out.join(format!("{}-{what}.png", actor.name));
        sheet::write(&path, &cells)?;
        Ok(near)
    }
}
