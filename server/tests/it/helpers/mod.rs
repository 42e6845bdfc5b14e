//! Several workers at one render: each has its own lease and draws its own ranges.

mod stage;

use crate::support::{assert_invalid, assert_refused, id, job_error, job_name};
use stage::{Hand, LEASE, LONGEST, MOST, Stage, history, range, succeeded};
use std::collections::BTreeMap;
use tonic::Code;
use yoto_proto::keys;
use yoto_proto::v1::job_attempt::Outcome as Ended;
use yoto_proto::v1::{
    JobKind, JobPriority, ListObjectsRequest, PauseJobsRequest, ResumeJobsRequest, job,
};
use yoto_proto::worker::v1::end_job_request::{Cancelled, Outcome, Returned};

#[tokio::test]
async fn two_workers_draw_every_picture_of_a_render_once() {
    let stage = Stage::new().await;
    let (first, second) = stage.two().await;
    let job = job_name(&first.lease);
    assert!(first.lease.token < second.lease.token);
    assert_eq!(second.lease.inputs, first.lease.inputs);
    let own = stage.take(&first, None).await.expect("again");
    assert_eq!(range(&own), Some((0, 4)), "a repeated call");
    let others = stage.take(&second, None).await.expect("the next range");
    assert_eq!(range(&others), Some((4, 4)));
    // Uncommitted files of a helper are not garbage.
    let key = keys::render(id(&job), second.lease.token, "unfinished");
    stage.service.put(&key, b"half").await;
    stage.service.collect(false, true).await;
    assert!(stage.service.has(&key));
    stage.heartbeat(&first, 3).await.expect("is heard");
    stage.heartbeat(&second, 9).await.expect("is heard");
    let drawn = stage.draw_all(&second, &others).await;
    let running = stage.service.get_job(&job).await;
    assert_eq!(running.progress.expect("of the first").step, 3);
    assert_eq!((running.outputs, running.worker), (4, first.name.clone()));
    let last = stage.take(&second, Some(drawn)).await.expect("the last");
    assert_eq!((range(&last), last.committed), (Some((8, 2)), 4));
    let drawn = stage.draw_all(&first, &own).await;
    let none = stage.take(&first, Some(drawn)).await.expect("answers");
    assert_eq!((range(&none), none.finished), (None, false));
    let drawn = stage.draw_all(&second, &last).await;
    let all = stage.take(&second, Some(drawn)).await.expect("answers");
    assert_eq!((range(&all), all.finished), (None, true));
    let end = stage.end(&second, succeeded(Vec::new()));
    end.await.expect("ends its own lease alone");
    assert_eq!(
        stage.service.get_job(&job).await.state(),
        job::State::Running
    );

    let all = stage.take(&first, None).await.expect("answers");
    let files = all.outputs.clone();
    let keys_by_file: BTreeMap<&str, &str> = (files.iter())
        .map(|it| (&*it.file, it.object.as_ref().map_or("", |it| &it.key)))
        .collect();
    assert_eq!((files.len(), keys_by_file.len()), (10, 10));
    for (index, (file, key)) in keys_by_file.into_iter().enumerate() {
        let hand = if index < 4 { &first } else { &second };
        assert_eq!(key, keys::render(id(&job), hand.lease.token, file));
    }
    stage
        .end(&first, succeeded(files))
        .await
        .expect("completes");
    let expected = [(1, Ended::Succeeded), (2, Ended::Helped)];
    assert_eq!(history(&stage, &job).await, expected);
    let repeated = stage.end(&second, succeeded(Vec::new()));
    repeated.await.expect("is a repetition");
    let request = ListObjectsRequest {
        parent: job,
        ..ListObjectsRequest::default()
    };
    let listed = stage.service.objects().list_objects(request).await;
    assert_eq!(listed.expect("lists").into_inner().objects.len(), 10);
}

#[tokio::test]
async fn a_number_of_pictures_beyond_the_limit_is_refused() {
    let stage = Stage::new().await;
    stage.render(JobPriority::Normal).await;
    let hand = stage.hand().await.expect("the render waits");
    for pictures in [0, MOST + 1, u32::MAX] {
        assert_invalid(stage.take_of(pictures, &hand, None).await, "pictures");
    }
    // The last file is that of a picture of another range.
    for index in [1, 3, LONGEST] {
        stage.draw(&hand, index).await.expect("commits");
    }
    let taken = stage.take_of(MOST, &hand, None).await;
    let taken = taken.expect("has the first range");
    assert_eq!((range(&taken), taken.committed), (Some((0, LONGEST)), 3));
    let files: Vec<_> = taken.outputs.iter().map(|it| it.file.as_str()).collect();
    assert_eq!(files, ["000001.png", "000003.png"]);
}

#[tokio::test]
async fn the_pictures_of_a_lost_helper_go_to_another_worker_and_its_late_writes_nowhere() {
    let stage = Stage::new().await;
    let (first, second) = stage.two().await;
    let job = job_name(&first.lease);
    stage.take(&second, None).await.expect("has a range");
    let early = stage.draw(&second, 4).await.expect("commits");
    stage.pass(LEASE * 1.5, &[&first]).await;
    let running = stage.service.get_job(&job).await;
    let seen = (running.state(), running.lost_workers);
    assert_eq!(seen, (job::State::Running, 1), "it goes on");
    stage.assert_late(&second).await;

    stage.take(&first, Some(0)).await.expect("the lost range");
    let taken = stage.take(&first, None).await.expect("the same");
    assert_eq!((range(&taken), taken.outputs), (Some((4, 4)), vec![early]));
    let expected = [(1, Ended::Running), (2, Ended::Lost)];
    assert_eq!(history(&stage, &job).await, expected);
    // A lost helper that comes back gets other work, but not this render.
    let again = stage.service.lease_or_help(&second.name, "", true).await;
    assert_eq!(again, None);
    assert!(stage.hand().await.expect("pictures are left").lease.helps);
}

#[tokio::test]
async fn helpers_go_on_when_the_worker_that_runs_the_render_is_lost() {
    let stage = Stage::new().await;
    let (first, second) = stage.two().await;
    let job = job_name(&first.lease);
    let taken = stage.take(&second, None).await.expect("has a range");
    // A better checkpoint comes, which the next lease must not begin to use.
    stage.train(2, 40.0).await;
    stage.pass(LEASE * 1.5, &[&second]).await;
    assert_eq!(
        stage.service.get_job(&job).await.state(),
        job::State::Queued
    );
    stage.assert_late(&first).await;
    let drawn = stage.draw_all(&second, &taken).await;
    // The range of the lost worker comes first.
    let next = stage.take(&second, Some(drawn)).await.expect("goes on");
    assert_eq!(range(&next), Some((0, 4)));
    let third = stage.hand().await.expect("the render waits");
    assert!(!third.lease.helps);
    assert!(third.lease.token > second.lease.token);
    let used = |hand: &Hand| hand.lease.inputs.clone().expect("inputs").checkpoints[0].step;
    assert_eq!((used(&second), used(&third)), (1, 1));
    let rest = stage.take(&third, None).await.expect("has the rest");
    assert_eq!((range(&rest), rest.committed), (Some((8, 2)), 4));
    stage.draw_all(&second, &next).await;
}

#[tokio::test]
async fn the_end_of_a_render_ends_the_leases_of_its_helpers() {
    let stage = Stage::new().await;
    let (first, second) = stage.two().await;
    let job = job_name(&first.lease);
    let early = stage.end(&second, Outcome::Cancelled(Cancelled {})).await;
    assert_refused(early, Code::FailedPrecondition, "CANCEL_NOT_REQUESTED");
    stage.cancel(&job).await;
    assert!(stage.heartbeat(&second, 1).await.expect("is told"));
    assert!(stage.hand().await.is_none(), "nobody else helps");
    let cancelled = stage.end(&first, Outcome::Cancelled(Cancelled {}));
    cancelled.await.expect("is cancelled");
    let expected = [(1, Ended::Cancelled), (2, Ended::Cancelled)];
    assert_eq!(history(&stage, &job).await, expected);
    stage.assert_late(&second).await;

    // While no worker runs it.
    let (first, second) = stage.two().await;
    let job = job_name(&first.lease);
    let returned = stage.end(&first, Outcome::Returned(Returned {}));
    returned.await.expect("is returned");
    stage.heartbeat(&second, 1).await.expect("goes on");
    assert_eq!(stage.cancel(&job).await.state(), job::State::Cancelled);
    stage.assert_late(&second).await;
}

#[tokio::test]
async fn a_worker_helps_when_nothing_else_waits_for_it() {
    let stage = Stage::new().await;
    let service = &stage.service;
    let urgent = stage.render(JobPriority::Urgent).await.name;
    let first = stage.hand().await.expect("the render waits");
    assert!(stage.hand().await.is_none(), "it was not divided yet");
    stage.take(&first, None).await.expect("divides it");
    // Helping comes before jobs of a lower priority only.
    let lower = stage.render(JobPriority::High).await.name;
    let helper = stage.hand().await.expect("pictures are left");
    assert_eq!(
        (job_name(&helper.lease), helper.lease.helps),
        (urgent, true)
    );
    let equal = stage.render(JobPriority::Urgent).await.name;
    for (waits, help) in [(equal, true), (lower, false)] {
        let plain = service.worker(&["render"]).await;
        let lease = service.lease_or_help(&plain, "", help).await;
        assert_eq!(lease.map(|it| job_name(&it)), Some(waits));
    }
    let (plain, trainer) = (
        service.worker(&["render"]).await,
        service.worker(&["train"]).await,
    );
    assert_eq!(service.lease(&plain).await, None, "it did not offer help");
    let lease = service.lease_or_help(&trainer, "", true).await;
    assert_eq!(lease, None, "it draws nothing");
    let kind = JobKind::Render.into();
    let pause = PauseJobsRequest {
        kind,
        reason: "maintenance".into(),
    };
    service.jobs().pause_jobs(pause).await.expect("pauses");
    assert!(stage.hand().await.is_none(), "renders are paused");
    let resume = ResumeJobsRequest { kind };
    service.jobs().resume_jobs(resume).await.expect("resumes");

    // A helper that failed at it is not used again, and the job does not fail.
    let failed = Outcome::Failed(job_error("INTERNAL", "no memory"));
    stage.end(&helper, failed).await.expect("ends");
    let job = service.get_job(&job_name(&first.lease)).await;
    assert_eq!(job.state(), job::State::Running);
    let again = service.lease_or_help(&helper.name, "", true).await;
    assert_eq!(again, None);

    // A repeated call gets the lost answer.
    let name = service.worker(&["render"]).await;
    let lease = service.lease_or_help(&name, "call", true).await;
    let again = service.lease_or_help(&name, "call", true).await;
    let [lease, again] = [lease, again].map(|it| it.map(|it| (it.token, it.helps)));
    assert!(lease.is_some_and(|(token, helps)| helps && token > first.lease.token));
    assert_eq!(lease, again);
}
