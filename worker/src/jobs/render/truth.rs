//! Ground truth of rendered pictures: frames of a person's own motion.

use super::{motion, request::Request};
use crate::jobs::JobFailure;
use std::sync::Arc;
use yoto_capture::{Shard, skeleton::Skeleton};
use yoto_proto::v1::MotionTransfer;

/// Ground truth of the views of a request.
pub(super) struct Truths {
    /// The capture, and each view's place in it.
    seen: Option<(Arc<Shard>, Vec<usize>)>,
}

impl Truths {
    /// There is no ground truth for these views.
    pub(super) fn none() -> Self {
        Self { seen: None }
    }

    /// The frames of the subject's own capture that a motion repeats. Captures have a black
    /// background, and the `body` that the model learned unless they were replaced since.
    pub(super) fn of_motion(
        request: &Request<'_>,
        transfer: &MotionTransfer,
        shard: Arc<Shard>,
        body: &Skeleton,
    ) -> Result<Self, JobFailure> {
        let lit_as_filmed = request.spec.light.is_none();
        let as_filmed = request.background == [0.0; 3] && !transfer.follow && lit_as_filmed;
        let own = transfer.driver == request.spec.subject && as_filmed;
        let same_body = Skeleton::from_track(&shard.track.skeleton)
            .is_ok_and(|theirs| theirs.rest == body.rest && theirs.parents == body.parents);
        if !own || !same_body {
            return Ok(Self::none());
        }
        let places = motion::places(transfer, &shard.track, "motion")?;
        Ok(Self {
            seen: Some((shard, places)),
        })
    }

    /// The filmed picture of view number `index`, of `size` (width, height): `[H, W, 3]`. `None` if there is
    /// none at that size.
    pub(super) fn picture(&self, index: usize, size: (u32, u32)) -> Option<Vec<u8>> {
        let (shard, places) = self.seen.as_ref()?;
        let (width, height) = size;
        let real = shard.image(*places.get(index)?).resized(width.max(height));
        let same_size = (real.width, real.height) == (width as usize, height as usize);
        same_size.then_some(real.rgb)
    }
}

/// `left` and `right` side by side, each of `width` pixels of 3 bytes.
pub(super) fn beside(left: &[u8], right: &[u8], width: u32) -> Vec<u8> {
    let row = 3 * width as usize;
    let rows = left.chunks_exact(row).zip(right.chunks_exact(row));
    rows.flat_map(|(left, right)| [left, right].concat())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_avatar::tradeoff::sweep::fidelity;
    use yoto_capture::ShardBuilder;
    use yoto_proto::v1::{IdentitySlot, Inputs, Model, RenderSpec, render_spec::What};
    use yoto_synthetic::SyntheticPerson;

    fn transfer(driver: &str) -> MotionTransfer {
        MotionTransfer {
            driver: driver.into(),
            frame_count: 2,
            frame_step: 3,
            size: 16,
            ..MotionTransfer::default()
        }
    }

    #[test]
    fn only_the_person_s_own_frames_over_black_at_their_size_are_known() {
        let (track, images) = SyntheticPerson::cast(1, 7)[0].capture(6, 24);
        let mut builder = ShardBuilder::new(track);
        for image in &images {
            builder.push(image).expect("fits");
        }
        let shard = Arc::new(builder.finish().expect("complete"));
        let body = Skeleton::from_track(&shard.track.skeleton).expect("a skeleton");
        let inputs = Inputs {
            model: Some(Model {
                slots: vec![IdentitySlot {
                    slot: 0,
                    subject: "subjects/a".into(),
                    trained: true,
                }],
                ..Model::default()
            }),
            ..Inputs::default()
        };
        let known = |driver: &str, background: Vec<f32>, body: &Skeleton| {
            let spec = RenderSpec {
                subject: "subjects/a".into(),
                what: Some(What::Motion(transfer(driver))),
                background,
                ..RenderSpec::default()
            };
            let request = Request::new(&spec, &inputs).expect("good");
            Truths::of_motion(&request, &transfer(driver), Arc::clone(&shard), body)
                .expect("good places")
        };
        let own = known("subjects/a", vec![], &body);
        let seen = images[3].resized(16).rgb;
        assert_eq!(
            own.picture(1, (16, 16)).as_ref(),
            Some(&seen),
            "frame 3 comes second"
        );
        let first = own.picture(0, (16, 16)).expect("frame 0 is known");
        assert!(fidelity(&first, &seen) < 100.0);
        assert_eq!(own.picture(1, (48, 48)), None, "larger than seen");
        let other = known("subjects/b", vec![], &body);
        assert_eq!(other.picture(1, (16, 16)), None);
        let white = known("subjects/a", vec![1.0; 3], &body);
        assert_eq!(white.picture(1, (16, 16)), None);
        let mut grown = body.clone();
        grown.rest[1][1] += 0.1;
        let replaced = known("subjects/a", vec![], &grown);
        assert_eq!(replaced.picture(1, (16, 16)), None);
    }

    #[test]
    fn pictures_stand_side_by_side() {
        let (left, right) = ([1, 2, 3, 4, 5, 6], [7, 8, 9, 10, 11, 12]);
        assert_eq!(
            beside(&left, &right, 1),
            [1, 2, 3, 7, 8, 9, 4, 5, 6, 10, 11, 12]
        );
    }
}
