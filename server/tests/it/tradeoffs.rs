//! Trade-offs: measured by evaluate jobs, kept with checkpoints, required by renders with a
//! quality instead of settings.

use crate::support;
use crate::support::{Service, assert_invalid, assert_refused, id};
use tonic::Code;
use yoto_proto::v1::render_quality::Want;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    EvaluateResult, EvaluateSpec, GetTradeoffRequest, ListCheckpointsRequest, Model, Orbit,
    RenderChoice, RenderQuality, RenderResult, RenderSpec, Scores, Subject, SubjectScores,
    TradeoffSpec, job_result, job_spec,
};
use yoto_proto::worker::v1::Lease;
use yoto_proto::{keys, tiers};

fn evaluate(model: &Model, tradeoff: bool) -> job_spec::Kind {
    job_spec::Kind::Evaluate(EvaluateSpec {
        model: model.name.clone(),
        tradeoff: tradeoff.then(TradeoffSpec::default),
        ..<_>::default()
    })
}

fn render(model: &Model, subject: &Subject, want: Want) -> job_spec::Kind {
    job_spec::Kind::Render(RenderSpec {
        model: model.name.clone(),
        subject: subject.name.clone(),
        what: Some(What::Orbit(Orbit {
            frame: 0,
            views: 1,
            size: 8,
        })),
        quality: Some(RenderQuality { want: Some(want) }),
        ..<_>::default()
    })
}

fn result(checkpoint: &str, subject: &Subject) -> EvaluateResult {
    let scores = Some(Scores {
        pictures: 2,
        ..<_>::default()
    });
    EvaluateResult {
        checkpoint: checkpoint.into(),
        subjects: vec![SubjectScores {
            subject: subject.name.clone(),
            scores,
            ..<_>::default()
        }],
        mean: scores,
        ..<_>::default()
    }
}

/// The result of a measured trade-off with `json` as the curve.
async fn measured(
    service: &Service,
    lease: &Lease,
    model: &Model,
    step: u64,
    subject: &Subject,
    json: &[u8],
) -> EvaluateResult {
    let key = keys::tradeoff(
        id(&model.name),
        id(&support::job_name(lease)),
        lease.token,
        step,
    );
    EvaluateResult {
        tradeoff: Some(service.put(&key, json).await),
        ..result(&format!("{}/checkpoints/{step}", model.name), subject)
    }
}

#[tokio::test]
async fn a_measured_trade_off_is_kept_with_its_checkpoint_and_serves_renders() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let worker = service.worker(&["train", "evaluate", "render"]).await;
    let model = service.model_of(&ada).await;
    let wish = || render(&model, &ada, Want::MaxSecondsPerFrame(0.5));
    let early = service.create_job(wish()).await;
    assert_refused(early, Code::FailedPrecondition, "NO_CHECKPOINT");
    let (training, _) = service.train_to(&model, &worker, 40).await;
    let unmeasured = service.create_job(wish()).await;
    let message = unmeasured
        .as_ref()
        .expect_err("refused")
        .message()
        .to_owned();
    assert!(message.contains("yoto tradeoff "), "{message}");
    assert_refused(unmeasured, Code::FailedPrecondition, "NO_TRADEOFF");
    let checkpoint = format!("{}/checkpoints/40", model.name);
    let get = |name: &str| {
        let request = GetTradeoffRequest {
            checkpoint: name.into(),
        };
        let mut models = service.models();
        async move { models.get_tradeoff(request).await }
    };
    assert_refused(get(&checkpoint).await, Code::NotFound, "NOT_FOUND");
    assert_invalid(get("models/x").await, "checkpoint");

    let kind = evaluate(&model, true);
    service.create_job(kind).await.expect("is queued");
    let lease = service.lease(&worker).await.expect("the evaluation waits");
    let kept = measured(&service, &lease, &model, 40, &ada, b"{\"version\":1}").await;
    let answer = job_result::Kind::Evaluate(kept.clone());
    service.complete(&lease, answer).await.expect("completes");
    let found = get(&checkpoint).await.expect("is kept").into_inner();
    assert_eq!(found.json, b"{\"version\":1}");
    assert_eq!(found.checkpoint, checkpoint);
    let request = ListCheckpointsRequest {
        model: model.name.clone(),
        ..<_>::default()
    };
    let listed = service.models().list_checkpoints(request).await;
    let listed = listed.expect("lists").into_inner().checkpoints;
    assert_eq!(listed[0].tradeoff, kept.tradeoff);

    // The render keeps the checkpoint that was the newest when it was queued.
    service.create_job(wish()).await.expect("is measured now");
    service.publish(&training, 50).await.expect("publishes");
    let lease = service.lease(&worker).await.expect("the render waits");
    let handed: Vec<u64> = lease
        .inputs
        .iter()
        .flat_map(|inputs| inputs.checkpoints.iter().map(|it| it.step))
        .collect();
    assert_eq!(handed, [40], "step 50 was never measured");
    let without = job_result::Kind::Render(RenderResult::default());
    let answer = service.complete(&lease, without).await;
    assert_invalid(answer, "result.render.choice");
    let with = job_result::Kind::Render(RenderResult {
        choice: Some(RenderChoice::default()),
        ..<_>::default()
    });
    service.complete(&lease, with).await.expect("completes");
    let again = service.create_job(wish()).await;
    assert_refused(again, Code::FailedPrecondition, "NO_TRADEOFF");
}

#[tokio::test]
async fn wishes_and_trade_offs_that_can_not_be_are_refused() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let worker = service.worker(&["train", "evaluate"]).await;
    let model = service.model_of(&ada).await;
    for (want, field) in [
        (Want::MaxSecondsPerFrame(f64::NAN), "max_seconds_per_frame"),
        (Want::MaxSecondsPerFrame(0.0), "max_seconds_per_frame"),
        (Want::MinPsnrDb(-3.0), "min_psnr_db"),
        (Want::Tier("ultra".into()), "tier"),
    ] {
        let answer = service.create_job(render(&model, &ada, want)).await;
        assert_invalid(answer, &format!("spec.render.quality.{field}"));
    }
    service.train_to(&model, &worker, 40).await;

    let kind = evaluate(&model, true);
    service.create_job(kind).await.expect("is queued");
    let lease = service.lease(&worker).await.expect("the evaluation waits");
    let good = measured(&service, &lease, &model, 40, &ada, b"{}").await;
    let mut bad = good.clone();
    bad.tradeoff = None;
    let answer = job_result::Kind::Evaluate(bad.clone());
    let answer = service.complete(&lease, answer).await;
    assert_invalid(answer, "result.evaluate.tradeoff");
    bad.tradeoff = Some(service.put("models/elsewhere.json", b"{}").await);
    let answer = service.complete(&lease, job_result::Kind::Evaluate(bad));
    assert_invalid(answer.await, "result.evaluate.tradeoff.key");
    let huge = measured(
        &service,
        &lease,
        &model,
        40,
        &ada,
        &vec![b' '; (1 << 20) + 1],
    )
    .await;
    let answer = service.complete(&lease, job_result::Kind::Evaluate(huge));
    assert_invalid(answer.await, "result.evaluate.tradeoff.bytes");
    let good = measured(&service, &lease, &model, 40, &ada, b"{}").await;
    let answer = service.complete(&lease, job_result::Kind::Evaluate(good));
    answer.await.expect("is good");

    // No trade-off was requested.
    let kind = evaluate(&model, false);
    service.create_job(kind).await.expect("is queued");
    let lease = service.lease(&worker).await.expect("the evaluation waits");
    let unasked = measured(&service, &lease, &model, 40, &ada, b"{}").await;
    let answer = service.complete(&lease, job_result::Kind::Evaluate(unasked));
    assert_invalid(answer.await, "result.evaluate.tradeoff");
}

#[tokio::test]
async fn real_time_needs_splats_and_no_trade_off() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let worker = service.worker(&["train", "render"]).await;
    let wish = |model: &Model| render(model, &ada, Want::Tier("realtime".into()));
    for tier in ["fast", tiers::SPLATS] {
        let model = service.model_of_tier(tier, tier).await;
        let model = service.joined(model, &ada).await;
        service.train_to(&model, &worker, 40).await;
        let answer = service.create_job(wish(&model)).await;
        if tier != tiers::SPLATS {
            let message = answer.as_ref().expect_err("fields").message().to_owned();
            assert!(message.contains("the tier splat"), "{message}");
            assert_invalid(answer, "spec.render.quality");
            continue;
        }
        answer.expect("needs nothing");
        let lease = service.lease(&worker).await.expect("the render waits");
        let inputs = lease.inputs.as_ref().expect("inputs");
        assert_eq!(inputs.checkpoints[0].step, 40);
        let without = job_result::Kind::Render(RenderResult::default());
        service.complete(&lease, without).await.expect("completes");
    }
}
