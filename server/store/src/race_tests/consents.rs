//! Revocations that meet the jobs that they end.

use super::*;
use yoto_proto::v1::ConsentPurpose;

impl Arena {
    /// Revokes the consent to trainings at the first store, and ends the jobs that it finds.
    async fn revoke(&self, subject: &str) -> Result<(), StoreError> {
        let purposes = [ConsentPurpose::ConsentTrain];
        let store = &self.pair.first;
        store
            .revoke_consent(&self.own, subject, &purposes, "", None)
            .await?;
        store.stop_without_consent(Some(subject)).await.map(drop)
    }

    async fn model_of(&self, subject: &str) -> String {
        let model = self.model().await;
        let joined = (self.pair.first)
            .add_identity(&self.own, &model, subject, None)
            .await;
        joined.expect("joins");
        model
    }

    /// The job has ended, and says why.
    async fn assert_stopped(&self, job: &str) {
        let job = self.pair.first.job(&self.own, job).await.expect("is there");
        let code = job.error.as_ref().map(|it| &*it.code);
        assert!(job.state().is_terminal(), "{job:?}");
        assert_eq!(code, Some("CONSENT"), "{job:?}");
    }
}

#[tokio::test]
async fn a_job_is_refused_or_found_by_the_revocation() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    for _ in 0..ROUNDS {
        let subject = arena.ready().await;
        let model = arena.model_of(&subject).await;
        let (revoked, queued) = tokio::join!(
            arena.revoke(&subject),
            arena
                .pair
                .second
                .create_job(&arena.own, Arena::training(&model), None),
        );
        revoked.expect("is revoked");
        match queued {
            Ok(job) => arena.assert_stopped(&id(&job.name)).await,
            Err(error) => assert_eq!(reason(&error), Some(ErrorReason::Consent)),
        }
    }
}

#[tokio::test]
async fn a_job_that_is_leased_meanwhile_ends_all_the_same() {
    let Some(arena) = Arena::open().await else {
        return;
    };
    for _ in 0..ROUNDS {
        let subject = arena.ready().await;
        let model = arena.model_of(&subject).await;
        let worker = arena.worker(&[JobKind::Train]).await;
        let job = arena.train(&model).await;
        let (revoked, _) = tokio::join!(
            arena.revoke(&subject),
            arena.lease(&arena.pair.second, &worker)
        );
        revoked.expect("is revoked");
        arena.assert_stopped(&job).await;
    }
}
