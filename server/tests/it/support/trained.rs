//! Models with a checkpoint, from which most tests of renders, exports and evaluations start.

use super::Service;
use yoto_proto::v1::{Checkpoint, Model, Subject};
use yoto_proto::worker::v1::Lease;

/// A model of one person with a checkpoint at step 1. Its `worker` runs trainings and renders.
pub(crate) struct Trained {
    pub subject: Subject,
    pub model: Model,
    pub worker: String,
    /// The training, which is still leased.
    pub training: Lease,
    pub checkpoint: Checkpoint,
}

impl Service {
    pub(crate) async fn trained(&self) -> Trained {
        let subject = self.ready_subject("Ada").await;
        let model = self.model_of(&subject).await;
        let worker = self.worker(&["train", "render"]).await;
        let (training, checkpoint) = self.train_to(&model, &worker, 1).await;
        Trained {
            subject,
            model,
            worker,
            training,
            checkpoint,
        }
    }

    /// Queues a training of `model`, leases it to `worker`, and publishes a checkpoint at `step`.
    pub(crate) async fn train_to(
        &self,
        model: &Model,
        worker: &str,
        step: u64,
    ) -> (Lease, Checkpoint) {
        self.train(model).await;
        let lease = self.lease(worker).await.expect("the training waits");
        let checkpoint = self.publish(&lease, step).await.expect("publishes");
        (lease, checkpoint)
    }
}
