//! Evaluate jobs: requirements, inputs, and valid results.

use crate::support::{Service, assert_invalid, assert_refused};
use tonic::Code;
use yoto_proto::names;
use yoto_proto::v1::{
    EvaluateResult, EvaluateSpec, Job, ListCheckpointsRequest, Model, Scores, Subject,
    SubjectScores, job, job_result, job_spec,
};
use yoto_proto::worker::v1::Lease;

fn spec(model: &Model, subjects: &[&Subject]) -> job_spec::Kind {
    job_spec::Kind::Evaluate(EvaluateSpec {
        model: model.name.clone(),
        subjects: subjects.iter().map(|it| it.name.clone()).collect(),
        ..<_>::default()
    })
}

fn result(checkpoint: &str, subject: &Subject) -> EvaluateResult {
    let scores = Some(Scores {
        pictures: 2,
        psnr: 27.0,
        ..<_>::default()
    });
    EvaluateResult {
        protocol: "held-out".into(),
        checkpoint: checkpoint.into(),
        subjects: vec![SubjectScores {
            subject: subject.name.clone(),
            display_name: subject.display_name.clone(),
            scores,
        }],
        mean: scores,
        device: "cpu".into(),
        tradeoff: None,
        notes: Vec::new(),
        image_size: 0,
    }
}

/// A model of one subject with a checkpoint, whose training is still leased.
async fn trained(service: &Service, subject: &Subject, worker: &str) -> (Model, String) {
    let model = service.model_of(subject).await;
    let (_, checkpoint) = service.train_to(&model, worker, 40).await;
    (model, checkpoint.name)
}

async fn queued(service: &Service, model: &Model, worker: &str) -> (Job, Lease) {
    let job = service.create_job(spec(model, &[])).await.expect("queued");
    let lease = service.lease(worker).await.expect("the evaluation waits");
    (job, lease)
}

#[tokio::test]
async fn an_evaluation_needs_a_checkpoint_and_subjects_of_the_model() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let bob = service.ready_subject("Bob").await;
    let model = service.model_of(&ada).await;
    let create = |kind| service.create_job(kind);
    assert_refused(
        create(spec(&model, &[])).await,
        Code::FailedPrecondition,
        "NO_CHECKPOINT",
    );
    assert_refused(
        create(spec(&model, &[&bob])).await,
        Code::FailedPrecondition,
        "NO_SLOT",
    );
    let twice = create(spec(&model, &[&ada, &ada])).await;
    assert_invalid(twice, "spec.evaluate.subjects[1]");
    let mut other = EvaluateSpec {
        model: model.name.clone(),
        protocol: "zju-all".into(),
        ..<_>::default()
    };
    let answer = create(job_spec::Kind::Evaluate(other.clone())).await;
    assert_invalid(answer, "spec.evaluate.protocol");
    other.protocol.clear();
    other.image_size = 7;
    let answer = create(job_spec::Kind::Evaluate(other)).await;
    assert_invalid(answer, "spec.evaluate.image_size");
}

#[tokio::test]
async fn a_worker_gets_model_shards_and_checkpoints_and_its_figures_are_kept() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let worker = service.worker(&["train", "evaluate"]).await;
    let (model, checkpoint) = trained(&service, &ada, &worker).await;
    let (job, lease) = queued(&service, &model, &worker).await;
    let inputs = lease.inputs.clone().expect("has inputs");
    assert_eq!(inputs.model.expect("a model").name, model.name);
    assert_eq!(inputs.checkpoints.len(), 1);
    assert_eq!(inputs.shards.len(), 1);
    assert_eq!(inputs.shards[0].subject, ada.name);
    let kept = result(&checkpoint, &ada);
    let answer = job_result::Kind::Evaluate(kept.clone());
    service.complete(&lease, answer).await.expect("completes");
    let job = service.get_job(&job.name).await;
    assert_eq!(job.state(), job::State::Succeeded);
    let found = job.result.and_then(|it| it.kind);
    assert_eq!(found, Some(job_result::Kind::Evaluate(kept)));
}

#[tokio::test]
async fn figures_that_can_not_be_are_refused() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let worker = service.worker(&["train", "evaluate"]).await;
    let (model, checkpoint) = trained(&service, &ada, &worker).await;
    let (_, lease) = queued(&service, &model, &worker).await;
    let good = result(&checkpoint, &ada);
    type Change = fn(&mut EvaluateResult);
    let cases: [(Change, &str); 5] = [
        (|it| it.checkpoint += "9", "result.evaluate.checkpoint"),
        (|it| it.subjects.clear(), "result.evaluate.subjects"),
        (
            |it| it.subjects[0].scores = None,
            "result.evaluate.subjects[0].scores",
        ),
        (
            |it| it.mean.as_mut().expect("has one").ssim = f64::NAN,
            "result.evaluate.mean",
        ),
        (
            |it| it.mean.as_mut().expect("has one").pictures = 0,
            "result.evaluate.mean",
        ),
    ];
    for (change, field) in cases {
        let mut bad = good.clone();
        change(&mut bad);
        let answer = service.complete(&lease, job_result::Kind::Evaluate(bad));
        assert_invalid(answer.await, field);
    }
    let answer = service.complete(&lease, job_result::Kind::Evaluate(good));
    answer.await.expect("is good");
}

#[tokio::test]
async fn the_best_checkpoint_is_measured_unless_another_is_asked_for() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let worker = service.worker(&["train", "evaluate"]).await;
    let model = service.model_of(&ada).await;
    service.train(&model).await;
    let training = service.lease(&worker).await.expect("the training waits");
    for (step, psnr) in [(10, 29.0), (20, 31.0), (30, 30.5)] {
        let published = service.publish_with(&training, step, psnr).await;
        published.expect("publishes");
    }
    let steps = |lease: Lease| -> Vec<u64> {
        let inputs = lease.inputs.expect("has inputs");
        inputs.checkpoints.iter().map(|it| it.step).collect()
    };
    let (_, lease) = queued(&service, &model, &worker).await;
    assert_eq!(steps(lease), [20, 30, 10]);
    let named = |step| {
        job_spec::Kind::Evaluate(EvaluateSpec {
            model: model.name.clone(),
            checkpoint: names::checkpoint(&model.name, step),
            ..<_>::default()
        })
    };
    service.create_job(named(10)).await.expect("queued");
    let lease = service.lease(&worker).await.expect("the evaluation waits");
    assert_eq!(steps(lease), [10]);
    let unknown = service.create_job(named(11)).await;
    assert_refused(unknown, Code::NotFound, "NOT_FOUND");
    let garbled = EvaluateSpec {
        model: model.name.clone(),
        checkpoint: "eleven".into(),
        ..<_>::default()
    };
    let garbled = service.create_job(job_spec::Kind::Evaluate(garbled)).await;
    assert_invalid(garbled, "spec.evaluate.checkpoint");
    let request = ListCheckpointsRequest {
        model: model.name.clone(),
        ..<_>::default()
    };
    let listed = service.models().list_checkpoints(request).await;
    let listed = listed.expect("lists").into_inner().checkpoints;
    let best: Vec<bool> = listed.iter().map(|it| it.best).collect();
    assert_eq!(best, [false, true, false]);
}
