//! Checkpoints that models keep, and why.

use crate::support;
use crate::support::{Service, assert_invalid, assert_refused};
use tonic::Code;
use yoto_proto::v1::{CreateModelRequest, Model, Retention, UpdateModelRequest};
use yoto_proto::worker::v1::Lease;

/// A service whose models keep the `newest` checkpoints and every n-th; with a model in training.
async fn training(newest: u32, every: u32) -> (Service, Model, Lease) {
    let service = Service::start_with(|config| {
        config.storage.keep_newest = newest;
        config.storage.keep_every = every;
    })
    .await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    (service, model, lease)
}

async fn kept(service: &Service, model: &Model) -> Vec<(u64, String)> {
    let all = service.checkpoints(&model.name).await.into_iter();
    all.map(|it| (it.step, it.kept_for.join(", "))).collect()
}

async fn steps(service: &Service, model: &Model) -> Vec<u64> {
    let kept = kept(service, model).await;
    kept.into_iter().map(|(step, _)| step).collect()
}

#[tokio::test]
async fn publishing_removes_what_a_model_does_not_keep() {
    let (service, model, lease) = training(2, 4).await;
    let mut all = Vec::new();
    for (step, psnr) in [
        (10, 30.0),
        (20, 25.0),
        (30, 24.0),
        (40, 23.0),
        (50, 22.0),
        (60, 21.0),
    ] {
        let published = service.publish_with(&lease, step, psnr).await;
        all.push(published.expect("publishes"));
    }
    let expected = [
        (60, "newest 2"),
        (50, "newest 2"),
        (40, "every 4th"),
        (10, "best"),
    ];
    let expected = expected.map(|(step, why)| (step, why.to_owned()));
    assert_eq!(kept(&service, &model).await, expected);

    // A late repetition changes nothing, whether or not the checkpoint still exists.
    service
        .publish_with(&lease, 60, 21.0)
        .await
        .expect("is known");
    service
        .publish_with(&lease, 20, 25.0)
        .await
        .expect("is known");
    assert_eq!(kept(&service, &model).await, expected);
    service.complete_training(&lease, &all[5]).await;
}

#[tokio::test]
async fn a_model_may_keep_more_or_fewer() {
    let (service, model, lease) = training(3, 10).await;
    let change = |newest, every| {
        let retention = Some(Retention { newest, every });
        let request = UpdateModelRequest {
            model: Some(Model {
                retention,
                name: model.name.clone(),
                ..Model::default()
            }),
            update_mask: Some(prost_types::FieldMask {
                paths: vec!["retention".into()],
            }),
        };
        let mut models = service.models();
        async move { models.update_model(request).await }
    };
    change(None, Some(1)).await.expect("keeps all");
    for step in 1..=6 {
        let psnr = if step == 1 { 30.0 } else { 20.0 };
        service
            .publish_with(&lease, step, psnr)
            .await
            .expect("publishes");
    }
    assert_eq!(steps(&service, &model).await, [6, 5, 4, 3, 2, 1]);
    let changed = change(Some(2), Some(0)).await.expect("keeps few");
    let expected = Some(Retention {
        newest: Some(2),
        every: Some(0),
    });
    assert_eq!(changed.into_inner().retention, expected);
    assert_eq!(steps(&service, &model).await, [6, 5, 1], "at once");
    assert_invalid(change(Some(0), None).await, "model.retention.newest");
    // As it was before the training.
    let request = UpdateModelRequest {
        model: Some(model.clone()),
        update_mask: Some(prost_types::FieldMask {
            paths: vec!["retention".into()],
        }),
    };
    let stale = service.models().update_model(request).await;
    assert_refused(stale, Code::Aborted, "ETAG_MISMATCH");
    let request = UpdateModelRequest {
        model: Some(model.clone()),
        update_mask: None,
    };
    assert_invalid(service.models().update_model(request).await, "update_mask");
    let request = CreateModelRequest {
        display_name: "m".into(),
        tier: "draft".into(),
        variant: "yoto".into(),
        retention: Some(Retention {
            newest: Some(0),
            every: None,
        }),
        ..<_>::default()
    };
    assert_invalid(
        service.models().create_model(request).await,
        "retention.newest",
    );
}

#[tokio::test]
async fn a_checkpoint_stays_while_a_job_uses_it() {
    let (service, model, lease) = training(1, 0).await;
    let ada = service.get_subject(&model.slots[0].subject).await;
    service
        .publish_with(&lease, 10, 20.0)
        .await
        .expect("publishes");
    // It uses the one that is the best when it starts.
    let any = service.render(&model, &ada, "").await;
    let first = &service.checkpoints(&model.name).await[0];
    let named = service.render(&model, &ada, &first.name).await;
    service
        .publish_with(&lease, 20, 30.0)
        .await
        .expect("publishes");
    service
        .publish_with(&lease, 30, 30.5)
        .await
        .expect("publishes");
    let found = kept(&service, &model).await;
    assert_eq!(found[0], (30, "newest, best".to_owned()));
    assert_eq!(found[1..], [(10, any.name.clone())]);

    let worker = service.worker(&["render"]).await;
    let used = |lease: &Lease| lease.inputs.clone().expect("has inputs").checkpoints[0].step;
    let of_any = service.lease(&worker).await.expect("the render waits");
    assert_eq!(used(&of_any), 30);
    service
        .publish_with(&lease, 40, 35.0)
        .await
        .expect("publishes");
    assert_eq!(steps(&service, &model).await, [40, 30, 10]);
    service.complete_render(&of_any).await;
    let of_named = service.lease(&worker).await.expect("the render waits");
    assert_eq!(
        (support::job_name(&of_named), used(&of_named)),
        (named.name, 10)
    );
    service
        .publish_with(&lease, 50, 36.0)
        .await
        .expect("publishes");
    assert_eq!(steps(&service, &model).await, [50, 10]);
    service.complete_render(&of_named).await;
    service
        .publish_with(&lease, 60, 37.0)
        .await
        .expect("publishes");
    assert_eq!(steps(&service, &model).await, [60]);
}
