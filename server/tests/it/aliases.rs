//! Names that people give checkpoints.

use crate::support::{Service, assert_invalid, assert_refused};
use tonic::{Code, Status};
use yoto_proto::names;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    Checkpoint, CreateJobRequest, CreateRenderRequest, DeleteCheckpointRequest,
    GetCheckpointRequest, Job, JobSpec, Orbit, RemoveAliasRequest, RenderSpec, SetAliasRequest,
    job_spec,
};

impl Service {
    async fn name_it(&self, checkpoint: &str, alias: &str) -> Result<Checkpoint, Status> {
        let request = SetAliasRequest {
            checkpoint: checkpoint.into(),
            alias: alias.into(),
        };
        let set = self.models().set_alias(request).await;
        set.map(|it| it.into_inner())
    }

    async fn called(&self, name: &str) -> Result<Checkpoint, Status> {
        let request = GetCheckpointRequest { name: name.into() };
        let found = self.models().get_checkpoint(request).await;
        found.map(|it| it.into_inner())
    }

    async fn unname(&self, model: &str, alias: &str) {
        let request = RemoveAliasRequest {
            model: model.into(),
            alias: alias.into(),
        };
        let removed = self.models().remove_alias(request).await;
        removed.expect("is removed");
    }
}

#[tokio::test]
async fn a_checkpoint_is_found_kept_and_ordered_by_its_alias() {
    let service = Service::start().await;
    let subject = service.ready_subject("Ada").await;
    let model = service.model_of(&subject).await;
    let worker = service.worker(&["train"]).await;
    let (lease, first) = service.train_to(&model, &worker, 1).await;
    let prod = format!("{}/checkpoints/prod", model.name);
    assert_refused(service.called(&prod).await, Code::NotFound, "NOT_FOUND");
    let named = service
        .name_it(&first.name, "prod")
        .await
        .expect("is named");
    assert_eq!(
        (&named.name, &*named.aliases),
        (&first.name, &["prod".to_owned()][..])
    );
    assert!(
        named.kept_for.contains(&"alias prod".to_owned()),
        "{named:?}"
    );
    // All others of the model's rule go.
    for step in 2..=9 {
        service.publish(&lease, step).await.expect("publishes");
    }
    let kept: Vec<u64> = service
        .checkpoints(&model.name)
        .await
        .iter()
        .map(|it| it.step)
        .collect();
    assert!(kept.contains(&1) && !kept.contains(&2), "{kept:?}");
    assert_eq!(service.called(&prod).await.expect("is found").step, 1);

    let order = orbit(&model.name, &subject.name, &prod);
    let queued = service
        .create_job(job_spec::Kind::Render(order.clone()))
        .await;
    let spec = queued.expect("is queued").spec.and_then(|it| it.kind);
    let Some(job_spec::Kind::Render(spec)) = spec else {
        panic!("{spec:?}");
    };
    assert_eq!(spec.checkpoint, first.name, "what has the alias now");

    // Another one takes it.
    let ninth = names::checkpoint(&model.name, 9);
    service.name_it(&ninth, "v2").await.expect("is named");
    let v2 = format!("{}/checkpoints/v2", model.name);
    service.name_it(&v2, "prod").await.expect("is moved");
    let found = service.called(&prod).await.expect("is found");
    assert_eq!(
        (found.step, &*found.aliases),
        (9, &["prod".to_owned(), "v2".to_owned()][..])
    );

    let missing = RenderSpec {
        checkpoint: format!("{}/checkpoints/none", model.name),
        ..order
    };
    let refused = service.create_job(job_spec::Kind::Render(missing)).await;
    assert_refused(refused, Code::NotFound, "NOT_FOUND");
}

/// An orbit of one view, of the checkpoint with this name.
fn orbit(model: &str, subject: &str, checkpoint: &str) -> RenderSpec {
    RenderSpec {
        model: model.into(),
        subject: subject.into(),
        checkpoint: checkpoint.into(),
        what: Some(What::Orbit(Orbit {
            frame: 0,
            views: 1,
            size: 8,
        })),
        ..<_>::default()
    }
}

/// The checkpoint that the order of a render has.
fn ordered(job: &Job) -> &str {
    match job.spec.as_ref().and_then(|it| it.kind.as_ref()) {
        Some(job_spec::Kind::Render(spec)) => &spec.checkpoint,
        other => panic!("{other:?}"),
    }
}

#[tokio::test]
async fn both_calls_take_aliases_and_repeat_their_first_answer_without_them() {
    let service = Service::start().await;
    let trained = service.trained().await;
    let (model, name) = (&trained.model.name, &trained.checkpoint.name);
    service.name_it(name, "prod").await.expect("is named");
    let spec = orbit(
        model,
        &trained.subject.name,
        &format!("{model}/checkpoints/prod"),
    );
    let render = |validate_only: bool, id: &str| CreateRenderRequest {
        spec: Some(spec.clone()),
        validate_only,
        request_id: id.into(),
        ..<_>::default()
    };
    let job = CreateJobRequest {
        spec: Some(JobSpec {
            kind: Some(job_spec::Kind::Render(spec.clone())),
        }),
        request_id: "a".into(),
        ..<_>::default()
    };
    let by_render = |request| async { service.renders().create_render(request).await };
    let by_job = |request| async { service.jobs().create_job(request).await };
    let checked = by_render(render(true, "")).await.expect("can be made");
    assert_eq!(ordered(checked.get_ref()), name);
    let first = by_render(render(false, "a")).await.expect("is queued");
    assert_eq!(ordered(first.get_ref()), name);
    let second = by_job(job.clone()).await.expect("is queued");
    assert_eq!(ordered(second.get_ref()), name);

    service.unname(model, "prod").await;
    let again = by_render(render(false, "a")).await.expect("is repeated");
    assert_eq!(again.get_ref().name, first.get_ref().name);
    let again = by_job(job).await.expect("is repeated");
    assert_eq!(again.get_ref().name, second.get_ref().name);
    let new = by_render(render(false, "b")).await;
    assert_refused(new, Code::NotFound, "NOT_FOUND");
}

#[tokio::test]
async fn a_checkpoint_with_an_alias_is_deleted_only_without_it() {
    let service = Service::start().await;
    let trained = service.trained().await;
    let (model, name) = (&trained.model.name, &trained.checkpoint.name);
    for bad in ["", "best", "2000", "Prod", "a b"] {
        assert_invalid(service.name_it(name, bad).await, "alias");
    }
    let other = names::checkpoint(model, 4711);
    assert_refused(
        service.name_it(&other, "prod").await,
        Code::NotFound,
        "NOT_FOUND",
    );
    service.name_it(name, "prod").await.expect("is named");
    let request = DeleteCheckpointRequest {
        name: name.clone(),
        ..<_>::default()
    };
    let refused = service.models().delete_checkpoint(request.clone()).await;
    assert_refused(refused, Code::FailedPrecondition, "CHECKPOINT_BUSY");
    for _ in 0..2 {
        service.unname(model, "prod").await;
    }
    assert_refused(
        service.called(&format!("{model}/checkpoints/prod")).await,
        Code::NotFound,
        "NOT_FOUND",
    );
    // The training that made it still runs, or it would go.
    let left = service.called(name).await.expect("is there");
    assert_eq!(left.aliases, [""; 0]);
}
