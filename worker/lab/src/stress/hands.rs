//! Hands from near, in gestures: the film of a person with fingers has none of these alone.

use super::{StressOptions, picture, sheet};
use crate::actor::Actor;
use crate::actor::gestures::{GESTURES, close};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use yoto_avatar::render::Renderer;
use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::smpl::WITH_FINGERS;
use yoto_capture::skeleton::transform::{add, scale};

/// Distance of the camera from the hand, and height of the view at the hand, metres.
const DISTANCE: f64 = 1.0;
const VIEW: f64 = 0.4;
/// Directions of the cameras from the hand: from before the person, and from before and above.
const FROM: [[f64; 3]; 2] = [[0.0, 0.0, 1.0], [0.0, 0.8, 0.6]];
/// Wrists, and the first joints of the middle fingers.
const HANDS: [[usize; 2]; 2] = [[20, 27], [21, 42]];

/// Mean PSNR in the box around a hand, dB, by gesture.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Hands(pub BTreeMap<String, f64>);

impl Hands {
    /// The mean over gestures, dB; `None` if no hands were looked at.
    pub fn mean(&self) -> Option<f64> {
        let sum: f64 = self.0.values().sum();
        (!self.0.is_empty()).then(|| sum / self.0.len() as f64)
    }
}

/// The hands of the person in `slot`, who stands with the arms out, and a sheet of them; nothing if the person has no fingers.
pub(super) fn measure(
    renderer: &Renderer,
    slot: usize,
    actor: &Actor,
    options: &StressOptions,
) -> anyhow::Result<Hands> {
    let mut hands = Hands::default();
    if actor.skeleton.joints() != WITH_FINGERS {
        return Ok(hands);
    }
    let mut cells = Vec::new();
    for (name, fingers) in GESTURES {
        let mut pose = Pose::rest(WITH_FINGERS);
        close(&mut pose, |finger| fingers[finger]);
        let joints = actor.skeleton.posed_joints(&pose);
        let mut sum = Vec::new();
        for [wrist, middle] in HANDS {
            let target = scale(add(joints[wrist], joints[middle]), 0.5);
            for from in FROM {
                let eye = add(target, scale(from, DISTANCE));
                let focal = f64::from(options.size) * DISTANCE / VIEW;
                let size = options.size;
                let camera = Camera::look_at(eye, target, [0.0, 1.0, 0.0], focal, size, size);
                let (figures, cell) =
                    picture(renderer, slot, actor, (name, &pose), (0.0, &camera))?;
                sum.extend(figures.map(|it| it.psnr));
                cells.push(cell);
            }
        }
        let mean = sum.iter().sum::<f64>() / sum.len().max(1) as f64;
        hands.0.insert(name.to_owned(), mean);
    }
    sheet::write(
        &options.out.join(format!("{}-hands.png", actor.name)),
        &cells,
    )?;
    Ok(hands)
}
