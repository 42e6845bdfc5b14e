//! The curve of a training: recorded with heartbeats, thinned, and without steps that were lost.

use crate::support::{Service, assert_refused, claim};
use tonic::Code;
use yoto_proto::v1::{DeleteJobRequest, GetJobMetricsRequest, MetricPoint, Progress};
use yoto_proto::worker::v1::{HeartbeatRequest, Lease};

async fn report(service: &Service, lease: &Lease, progress: Progress) {
    let request = HeartbeatRequest {
        claim: Some(claim(lease)),
        progress: Some(progress),
    };
    let told = service.workers().heartbeat(request).await;
    told.expect("holds the lease");
}

fn at(step: u64, psnr: Option<f64>) -> Progress {
    Progress {
        step,
        loss: Some(1.0 / step as f64),
        train_seconds: step as f64 / 10.0,
        psnr,
        ssim: psnr.map(|_| 0.9),
        ..Progress::default()
    }
}

async fn points(service: &Service, name: &str) -> Vec<MetricPoint> {
    let request = GetJobMetricsRequest { name: name.into() };
    let answer = service.jobs().get_job_metrics(request).await;
    answer.expect("is there").into_inner().points
}

async fn training(service: &Service) -> Lease {
    let subject = service.ready_subject("Ada").await;
    service.train(&service.model_of(&subject).await).await;
    let worker = service.worker(&["train"]).await;
    service.lease(&worker).await.expect("the training waits")
}

#[tokio::test]
async fn heartbeats_leave_a_curve_with_each_measurement_once() {
    let service = Service::start().await;
    let lease = training(&service).await;
    let name = crate::support::job_name(&lease);
    assert_eq!(points(&service, &name).await, []);
    let lone = Progress {
        phase: "reading".into(),
        ..Progress::default()
    };
    report(&service, &lease, lone).await;
    for (step, psnr) in [
        (1, None),
        (2, None),
        (2, None),
        (3, Some(20.0)),
        (4, Some(20.0)),
    ] {
        report(&service, &lease, at(step, psnr)).await;
    }
    let seen = points(&service, &name).await;
    let figures: Vec<_> = seen.iter().map(|it| (it.step, it.psnr, it.ssim)).collect();
    let expected = [
        (1, None, None),
        (2, None, None),
        (3, Some(20.0), Some(0.9)),
        (4, None, None),
    ];
    assert_eq!(figures, expected);
    assert_eq!((seen[1].loss, seen[1].seconds), (Some(0.5), 0.2));

    // Another worker resumes from a checkpoint at step 2.
    report(&service, &lease, at(3, None)).await;
    let steps: Vec<_> = points(&service, &name).await;
    let steps: Vec<_> = steps.iter().map(|it| it.step).collect();
    assert_eq!(steps, [1, 2, 3], "step 4 was lost");
    let request = GetJobMetricsRequest {
        name: "jobs/none".into(),
    };
    let refused = service.jobs().get_job_metrics(request).await;
    assert_refused(refused, Code::NotFound, "NOT_FOUND");
}

#[tokio::test]
async fn a_long_training_keeps_a_bounded_number_of_points() {
    let service = Service::start().await;
    let lease = training(&service).await;
    let name = crate::support::job_name(&lease);
    for step in 1..=1100 {
        // More measurements than there is room for.
        let psnr = Some(20.0 + step as f64 / 1e3);
        report(&service, &lease, at(step, psnr)).await;
    }
    let seen = points(&service, &name).await;
    assert!((512..=1025).contains(&seen.len()), "{}", seen.len());
    assert_eq!((seen[0].step, seen[seen.len() - 1].step), (1, 1100));
    let longest = seen.windows(2).map(|it| it[1].step - it[0].step).max();
    assert_eq!(longest, Some(2));
    assert!(seen.iter().all(|it| it.psnr.is_some()));
    let error = crate::support::job_error("DIVERGED", "");
    let ended = service.end(
        &lease,
        yoto_proto::worker::v1::end_job_request::Outcome::Failed(error),
    );
    ended.await.expect("is recorded");
    let request = DeleteJobRequest {
        name: name.clone(),
        ..<_>::default()
    };
    service.jobs().delete_job(request).await.expect("is gone");
    let request = GetJobMetricsRequest { name };
    let refused = service.jobs().get_job_metrics(request).await;
    assert_refused(refused, Code::NotFound, "NOT_FOUND");
}
