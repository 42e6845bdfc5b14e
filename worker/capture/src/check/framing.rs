//! Counts the frames that cut off head, hands or feet.

use super::fit::view;
use crate::skeleton::Skeleton;
use yoto_proto::pose_track::PoseTrack;

/// Joints below the first and above the second are those of feet and head, as shares of the height at rest.
const FEET: f64 = 0.1;
const HEAD: f64 = 0.9;
/// Joints farther aside than this are those of hands, as a share of the farthest joint's distance at rest.
const HANDS: f64 = 0.8;

/// Counts of frames that cut off a part of the body.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Framing {
    /// All frames.
    pub frames: usize,
    pub head: usize,
    pub hands: usize,
    pub feet: usize,
}

impl Framing {
    pub(super) fn of(track: &PoseTrack, skeleton: &Skeleton) -> Self {
        let bounds = skeleton.rest_bounds(0.0);
        let [low, high] = [bounds.min[1], bounds.max[1]];
        let [root_x, _, _] = skeleton.root();
        let aside = |joint: usize| (skeleton.rest[joint][0] - root_x).abs();
        let farthest = (0..skeleton.rest.len()).map(aside).fold(0.0, f64::max);
        let height = |joint: usize| (skeleton.rest[joint][1] - low) / (high - low).max(1e-9);
        let parts = |joint: usize| {
            [
                height(joint) > HEAD,
                // Where arms hang at rest, nothing is far aside.
                farthest > 0.3 * (high - low) && aside(joint) > HANDS * farthest,
                height(joint) < FEET,
            ]
        };
        let [width, tall] = track.image_size.map(f64::from);
        let mut counts = [0; 3];
        for frame in &track.frames {
            let (pose, camera) = view(frame, track.image_size);
            let mut outside = [false; 3];
            for (joint, at) in skeleton.posed_joints(&pose).into_iter().enumerate() {
                let shown = camera.project(at);
                if shown.is_some_and(|[x, y]| (0.0..width).contains(&x) && (0.0..tall).contains(&y))
                {
                    continue;
                }
                for (outside, part) in outside.iter_mut().zip(parts(joint)) {
                    *outside |= part;
                }
            }
            for (count, outside) in counts.iter_mut().zip(outside) {
                *count += usize::from(outside);
            }
        }
        let [head, hands, feet] = counts;
        Self {
            frames: track.frames.len(),
            head,
            hands,
            feet,
        }
    }

    /// The parts by name, with the number of frames in which each is outside.
    pub(super) fn outside(&self) -> [(&'static str, usize); 3] {
        [
            ("head", self.head),
            ("hands", self.hands),
            ("feet", self.feet),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_synthetic::SyntheticPerson;

    /// A person whose pictures are cut by `rows` below.
    fn framing(rows: u32) -> Framing {
        let (mut track, _) = SyntheticPerson::cast(1, 7)[0].capture(12, 96);
        track.image_size[1] -= rows;
        let skeleton = Skeleton::from_track(&track.skeleton).expect("a skeleton");
        Framing::of(&track, &skeleton)
    }

    #[test]
    fn feet_below_the_picture_are_counted_and_a_whole_body_is_not() {
        let whole = framing(0);
        assert_eq!([whole.head, whole.hands, whole.feet], [0; 3], "{whole:?}");
        let cut = framing(30);
        assert_eq!((cut.frames, cut.feet, cut.head), (12, 12, 0), "{cut:?}");
    }
}
