//! A film without fingers of somebody whose splats lie on fingers.

use super::TrainPerson;
use std::sync::Arc;
use yoto_capture::skeleton::Skeleton;
use yoto_capture::skeleton::fingers::with_fingers;
use yoto_capture::skeleton::smpl::{FINGERS, WITH_FINGERS};

impl TrainPerson {
    /// This person with fingers at rest, if the model knows them with this number of `joints` and the film has no fingers: the bones of
    /// their splats must stay.
    pub(crate) fn with_known_fingers(self, joints: usize) -> Self {
        if joints != WITH_FINGERS {
            return self;
        }
        let plain = Skeleton::from_track(&self.shard.track.skeleton).ok();
        let Some(skeleton) = plain.and_then(|it| with_fingers(&it)) else {
            return self;
        };
        let mut shard = (*self.shard).clone();
        shard.track.skeleton = skeleton.to_track();
        for frame in &mut shard.track.frames {
            frame.pose.extend([[0.0; 3]; FINGERS.len()].as_flattened());
        }
        Self {
            shard: Arc::new(shard),
            ..self
        }
    }
}
