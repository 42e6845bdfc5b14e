//! The filmed pictures that a render repeats.

use crate::plan::background;
use std::sync::Arc;
use yoto_capture::Shard;
use yoto_capture::skeleton::Skeleton;
use yoto_proto::v1::{MotionTransfer, RenderSpec};

/// Filmed pictures of the views of a render.
#[derive(Debug)]
pub struct Truth {
    shard: Arc<Shard>,
    /// Position in the capture of each view's frame.
    positions: Vec<usize>,
}

/// Whether `transfer` repeats the subject's own motion as it was filmed. Captures have a black background.
pub(crate) fn repeats_own_motion(spec: &RenderSpec, transfer: &MotionTransfer) -> bool {
    let lit_as_filmed = spec.light.is_none();
    let seen_as_filmed = background(spec) == [0.0; 3] && !transfer.follow;
    transfer.driver == spec.subject && seen_as_filmed && lit_as_filmed
}

impl Truth {
    /// The frames at the `positions` of the subject's own capture that `transfer` repeats. None if it shows
    /// something else, or if the capture's skeleton is no longer the `body` that the model learned.
    pub(crate) fn of_motion(
        spec: &RenderSpec,
        transfer: &MotionTransfer,
        shard: &Arc<Shard>,
        positions: &[usize],
        body: &Skeleton,
    ) -> Option<Self> {
        let same_body = || {
            let skeleton = Skeleton::from_track(&shard.track.skeleton);
            skeleton.is_ok_and(|it| it.rest == body.rest && it.parents == body.parents)
        };
        let known = repeats_own_motion(spec, transfer) && same_body();
        known.then(|| Self {
            shard: Arc::clone(shard),
            positions: positions.to_vec(),
        })
    }

    /// The filmed picture of the view with the `index`, of `size` (width, height): `[H, W, 3]`. `None` if no
    /// picture has that size.
    pub fn picture(&self, index: usize, (width, height): (u32, u32)) -> Option<Vec<u8>> {
        let position = *self.positions.get(index)?;
        let filmed = self.shard.image(position).resized(width.max(height));
        let same_size = (filmed.width, filmed.height) == (width as usize, height as usize);
        same_size.then_some(filmed.rgb)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::positions;
    use yoto_capture::ShardBuilder;
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
        let known = |driver: &str, background: Vec<f32>, body: &Skeleton| {
            let spec = RenderSpec {
                subject: "subjects/a".into(),
                background,
                ..RenderSpec::default()
            };
            let transfer = transfer(driver);
            let positions = positions(&transfer, &shard.track, "motion").expect("frames");
            Truth::of_motion(&spec, &transfer, &shard, &positions, body)
        };
        let own = known("subjects/a", vec![], &body).expect("was filmed");
        let filmed = images[3].resized(16).rgb;
        assert_eq!(
            own.picture(1, (16, 16)).as_ref(),
            Some(&filmed),
            "frame 3 comes second"
        );
        let first = own.picture(0, (16, 16)).expect("frame 0 is known");
        assert_ne!(first, filmed);
        assert_eq!(own.picture(1, (48, 48)), None, "larger than filmed");
        assert!(known("subjects/b", vec![], &body).is_none());
        assert!(known("subjects/a", vec![1.0; 3], &body).is_none());
        let mut grown = body.clone();
        grown.rest[1][1] += 0.1;
        assert!(known("subjects/a", vec![], &grown).is_none(), "replaced");
    }
}
