//! A film without fingers or face of somebody whose splats lie on them.

use super::TrainPerson;
use std::sync::Arc;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::parts::with_count;

impl TrainPerson {
    /// This person with fingers and face at rest, if the model knows them with this number of `joints` and the film has fewer: the bones of
    /// their splats must stay.
    pub(crate) fn with_known_parts(self, joints: usize) -> Self {
        let Ok(plain) = Skeleton::from_track(&self.shard.track.skeleton) else {
            return self;
        };
        let Some(skeleton) = with_count(&plain, joints).filter(|it| it.joints() > plain.joints())
        else {
            return self;
        };
        let mut shard = (*self.shard).clone();
        shard.track.skeleton = skeleton.to_track();
        for frame in &mut shard.track.frames {
            frame.pose.resize(3 * skeleton.joints(), 0.0);
        }
        Self {
            shard: Arc::new(shard),
            ..self
        }
    }
}
