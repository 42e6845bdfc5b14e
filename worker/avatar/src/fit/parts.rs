//! Parts of the body that are small in a picture and matter most to people: the head and the hands. A grid over the whole
//! person has three pixels on a hand.

use yoto_capture::camera::{Camera, Pose};
use yoto_capture::skeleton::Skeleton;

/// Names of joints at the ends of limbs, how far the middle of the part is beyond the joint, and its radius, metres.
const PARTS: [(&[&str], f64, f64); 2] = [(&["head"], 0.09, 0.17), (&["wrist", "hand"], 0.07, 0.11)];
/// Number of pixels of a part's grid, about (docs/research/refinement.md).
pub(super) const PIXELS: f64 = 150.0;
/// Smallest side of a box, pixels: less shows nothing.
const SMALLEST: usize = 8;

/// First and last pixel of a box.
pub(super) type PixelBox = [[usize; 2]; 2];

/// The boxes of head and hands of a body in `pose`, as far as they are in the picture.
pub(super) fn boxes(skeleton: &Skeleton, pose: &Pose, camera: &Camera) -> Vec<PixelBox> {
    let joints = skeleton.posed_joints(pose);
    let children = skeleton.children();
    let mut found = Vec::new();
    for (names, beyond, radius) in PARTS {
        let is = |joint: usize| {
            let name = skeleton.names[joint].to_ascii_lowercase();
            names.iter().any(|part| name.contains(part))
        };
        for joint in (0..joints.len()).filter(|joint| is(*joint)) {
            // The last of a chain of such joints stands for the part.
            let Some(parent) = skeleton.parents[joint] else {
                continue;
            };
            if children[joint].iter().any(|child| is(*child)) {
                continue;
            }
            let along: [f64; 3] = std::array::from_fn(|a| joints[joint][a] - joints[parent][a]);
            let length = along.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-9);
            let middle = std::array::from_fn(|a| joints[joint][a] + beyond / length * along[a]);
            found.extend(around(camera, middle, radius));
        }
    }
    found
}

/// The box of a ball; `None` if less than [`SMALLEST`] pixels of it are in the picture.
fn around(camera: &Camera, middle: [f64; 3], radius: f64) -> Option<PixelBox> {
    let [x, y] = camera.project(middle)?;
    let depth = (0..3).map(|a| camera.e[2][a] * middle[a]).sum::<f64>() + camera.e[2][3];
    let size = [camera.width, camera.height];
    let at = [x, y];
    let reach: [f64; 2] = std::array::from_fn(|a| camera.k[a][a].abs() * radius / depth);
    let low: [f64; 2] = std::array::from_fn(|a| (at[a] - reach[a]).max(0.0));
    let high: [f64; 2] = std::array::from_fn(|a| (at[a] + reach[a]).min(f64::from(size[a]) - 1.0));
    let large = (0..2).all(|a| high[a] - low[a] >= SMALLEST as f64);
    large.then(|| [low.map(|v| v as usize), high.map(|v| v as usize)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_synthetic::SyntheticPerson;

    #[test]
    fn a_head_and_two_hands_have_boxes() {
        let person = SyntheticPerson::cast(1, 7).remove(0);
        let skeleton = Skeleton::from_track(&person.skeleton()).expect("a skeleton");
        let pose = person.motion(4).remove(0);
        let camera = SyntheticPerson::train_camera(320);
        let joints = skeleton.posed_joints(&pose);
        let found = boxes(&skeleton, &pose, &camera);
        assert_eq!(found.len(), 3);
        for name in ["head", "l_hand", "r_hand"] {
            let joint = skeleton.names.iter().position(|it| it == name);
            let at = camera.project(joints[joint.expect("is one")]);
            let at = at.expect("in front").map(|v| v as usize);
            let inside = |[low, high]: &PixelBox| {
                (0..2).all(|a| (low[a]..=high[a]).contains(&at[a]) && high[a] - low[a] < 80)
            };
            assert!(found.iter().any(inside), "{name} at {at:?}: {found:?}");
        }
    }

    #[test]
    fn parts_of_a_few_pixels_have_none() {
        let person = SyntheticPerson::cast(1, 7).remove(0);
        let skeleton = Skeleton::from_track(&person.skeleton()).expect("a skeleton");
        let pose = person.motion(4).remove(0);
        let camera = SyntheticPerson::train_camera(40);
        assert_eq!(boxes(&skeleton, &pose, &camera), Vec::<PixelBox>::new());
    }
}
