//! A person is erased: nothing of them is left in any row or object, and everybody else's part stays.

use crate::support::{
    Service, assert_invalid, assert_refused, claim, eventually, file, id, job_name,
};
use tonic::Code;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    Checkpoint, ConsentPurpose, CreateJobRequest, EraseSubjectRequest, Erasure, GetErasureRequest,
    GetJobRequest, GrantConsentRequest, JobSpec, Model, Orbit, RemovedPerson, RenderSpec, Subject,
    TrainResult, erasure, job, job_result, job_spec,
};
use yoto_proto::worker::v1::{Lease, PublishCheckpointRequest};
use yoto_proto::{keys, names};

/// In the person's name and in all bytes of theirs.
const TOKEN: &str = "Residua Q7x";
const BYTES: &[u8] = b"before Residua Q7x after";

impl Service {
    async fn erase(&self, subject: &Subject) -> Erasure {
        self.erase_and(subject, false).await
    }

    /// The same, and others are trained anew if `retrain` is set.
    async fn erase_and(&self, subject: &Subject, retrain: bool) -> Erasure {
        let request = EraseSubjectRequest {
            name: subject.name.clone(),
            display_name: subject.display_name.clone(),
            retrain,
        };
        let begun = self.subjects().erase_subject(request).await;
        begun.expect("begins").into_inner()
    }

    async fn erasure_in(&self, name: &str, state: erasure::State) -> Erasure {
        eventually("the end of the erasure", async || {
            let request = GetErasureRequest { name: name.into() };
            let found = self.subjects().get_erasure(request).await;
            let found = found.expect("is there").into_inner();
            (found.state() == state).then_some(found)
        })
        .await
    }

    /// Publishes a checkpoint that was written anew, which has only `slots`.
    async fn rewrite(&self, lease: &Lease, model: &Model, step: u64, slots: &[u32]) {
        let job = job_name(lease);
        let folder = keys::checkpoint(id(&model.name), id(&job), lease.token, step);
        let checkpoint = Checkpoint {
            name: names::checkpoint(&model.name, step),
            step,
            manifest: Some(self.manifest(&folder, step).await),
            bytes: 7,
            slots: slots.to_vec(),
            ..<_>::default()
        };
        let request = PublishCheckpointRequest {
            claim: Some(claim(lease)),
            checkpoint: Some(checkpoint),
            save_seconds: 0.1,
        };
        let published = self.workers().publish_checkpoint(request).await;
        published.expect("is published");
    }
}

fn report(erasure: &Erasure) -> serde_json::Value {
    serde_json::from_str(&erasure.report).expect("JSON")
}

/// A service with a person whose name and bytes have the token, and a model of them and Bob with two checkpoints. Also the
/// worker, and the names of two jobs that show the person.
struct Stage {
    service: Service,
    person: Subject,
    model: Model,
    worker: String,
    training: String,
}

async fn stage() -> Stage {
    let service = Service::start().await;
    let person = service.subject(TOKEN).await;
    let files = vec![file("poses.json", BYTES), file("frames/0.png", BYTES)];
    let uploaded = service.upload(&person.name, files).await.expect("uploads");
    let ingest = service.worker(&["ingest"]).await;
    let lease = service.lease(&ingest).await.expect("the ingest job waits");
    service.complete_ingest(&lease).await;
    let capture = id(&uploaded.name).to_owned();
    let extra = format!("captures/{capture}/{}-1", id(&job_name(&lease)));
    service.put(&format!("{extra}/thumbnail.png"), BYTES).await;
    let half = [file("poses.json", b"{}"), file("a", BYTES)];
    let open = service.open_upload(&person.name, &half).await;
    open.expect("is opened");
    let grant = GrantConsentRequest {
        subject: person.name.clone(),
        purposes: vec![ConsentPurpose::ConsentTrain.into()],
        note: format!("of {TOKEN}"),
        request_id: format!("grant {TOKEN}"),
        ..<_>::default()
    };
    let granted = service.subjects().grant_consent(grant).await;
    granted.expect("is recorded");
    let bob = service.ready_subject("Bob").await;
    let model = service.model("shared").await;
    let model = service.joined(model, &person).await;
    let model = service.joined(model, &bob).await;
    let worker = service.worker(&["train", "render"]).await;
    let (lease, _) = service.train_to(&model, &worker, 1).await;
    let last = service.publish(&lease, 2).await.expect("publishes");
    for step in [1, 2] {
        let job = job_name(&lease);
        let folder = keys::checkpoint(id(&model.name), id(&job), lease.token, step);
        service.put(&format!("{folder}/weights"), BYTES).await;
    }
    // A checkpoint that was removed before.
    let older = format!("models/{}/{}-7/000000009/w", id(&model.name), id(&bob.name));
    service.put(&older, BYTES).await;
    let training = job_name(&lease);
    let result = TrainResult {
        checkpoint: last.name,
        notes: vec![format!("{TOKEN}: poses refined")],
        ..<_>::default()
    };
    let ended = service.complete(&lease, job_result::Kind::Train(result));
    ended.await.expect("ends");
    let order = RenderSpec {
        model: model.name.clone(),
        subject: person.name.clone(),
        what: Some(What::Orbit(Orbit {
            frame: 0,
            views: 1,
            size: 8,
        })),
        ..<_>::default()
    };
    let order = CreateJobRequest {
        spec: Some(JobSpec {
            kind: Some(job_spec::Kind::Render(order)),
        }),
        request_id: format!("render {TOKEN}"),
        ..<_>::default()
    };
    let queued = service.jobs().create_job(order.clone()).await;
    queued.expect("is queued");
    let lease = service.lease(&worker).await.expect("the render waits");
    let picture = service.complete_render(&lease).await;
    service.put(&picture, BYTES).await;
    // Another one still waits.
    let again = CreateJobRequest {
        request_id: String::new(),
        ..order
    };
    service.jobs().create_job(again).await.expect("is queued");
    Stage {
        service,
        person,
        model,
        worker,
        training,
    }
}

#[tokio::test]
async fn nothing_of_a_person_is_left_and_others_stay() {
    let stage = stage().await;
    let Stage {
        service,
        person,
        model,
        worker,
        training,
    } = &stage;
    // A collection has noted a folder of theirs, which is a part of what goes.
    let captures = service.get_subject(&person.name).await.captures;
    let capture = id(&captures[0]);
    let noted = format!(
        "INSERT INTO garbage (folder, deleted, garbage_since) VALUES ('captures/{capture}/j-1', 0, 1.0)"
    );
    service.database.run(&noted).await;
    let planted = service.residue(TOKEN).await;
    assert!(planted.len() >= 7, "{planted:?}");
    let wrong = EraseSubjectRequest {
        name: person.name.clone(),
        display_name: "Bob".into(),
        ..<_>::default()
    };
    let refused = service.subjects().erase_subject(wrong).await;
    assert_invalid(refused, "display_name");

    let begun = service.erase(person).await;
    assert_eq!(begun.state(), erasure::State::Running);
    assert_eq!(service.erase(person).await.name, begun.name);
    let more = service
        .open_upload(&person.name, &[file("poses.json", b"1")])
        .await;
    assert_refused(more, Code::FailedPrecondition, "SUBJECT_BUSY");

    let lease = service.lease_eventually(worker).await;
    let waits = service
        .erasure_in(&begun.name, erasure::State::Running)
        .await;
    assert!(waits.message.contains(&job_name(&lease)), "{waits:?}");
    let order = lease.job.clone().and_then(|it| it.spec).expect("an order");
    let Some(job_spec::Kind::Train(order)) = order.kind else {
        panic!("{order:?}");
    };
    assert_eq!(order.leave, person.name);
    let inputs = lease.inputs.clone().expect("inputs");
    assert_eq!((inputs.checkpoints.len(), inputs.shards.len()), (2, 0));
    for step in [1, 2] {
        service.rewrite(&lease, model, step, &[1]).await;
    }
    let removed = |step, trunk_saw_them| RemovedPerson {
        step,
        trunk_saw_them,
        tensors: 3,
        ..<_>::default()
    };
    let result = TrainResult {
        checkpoint: names::checkpoint(&model.name, 2),
        removed: vec![removed(1, false), removed(2, true)],
        ..<_>::default()
    };
    let ended = service.complete(&lease, job_result::Kind::Train(result));
    ended.await.expect("ends");
    let done = service.erasure_in(&begun.name, erasure::State::Done).await;

    assert_eq!(service.residue(TOKEN).await, [""; 0]);
    let told = report(&done);
    assert_eq!(told["search"]["objects_left"], 0, "{told}");
    assert_eq!(told["search"]["ids_left"], serde_json::json!([]), "{told}");
    assert_eq!(
        told["search"]["names_left"],
        serde_json::json!([]),
        "{told}"
    );
    let left = &told["models"][0];
    assert_eq!(left["shared_weights"], "saw_them", "{told}");
    assert_eq!(
        (&left["checkpoints_rewritten"], &left["tensors"]),
        (&2.into(), &6.into())
    );
    assert!(
        told["objects"]["models"]["objects"].as_u64() >= Some(3),
        "{told}"
    );
    assert!(told["rows"]["jobs"].as_u64() >= Some(3), "{told}");
    assert_eq!((done.signature.len(), done.public_key.len()), (128, 64));
    assert!(!done.report.contains(TOKEN));

    // What is of others stays: their slot, both checkpoints, and the training.
    let kept = service.checkpoints(&model.name).await;
    let slots: Vec<_> = kept.iter().map(|it| it.slots.clone()).collect();
    assert_eq!(slots, [[1], [1]]);
    let training = service.get_job(training).await;
    assert_eq!(training.state(), job::State::Succeeded);
    let carol = service.ready_subject("Carol").await;
    let grown = service.joined(model.clone(), &carol).await;
    let slots: Vec<u32> = grown.slots.iter().map(|it| it.slot).collect();
    assert_eq!(slots, [1, 2], "slot 0 is never used again");
    let again = service.erase(person).await;
    assert_eq!(again, done, "the answer stays");
}

#[tokio::test]
async fn others_are_trained_anew_where_shared_weights_saw_the_person() {
    for saw in [true, false] {
        let stage = stage().await;
        let Stage {
            service,
            person,
            model,
            worker,
            ..
        } = &stage;
        let begun = service.erase_and(person, true).await;
        let lease = service.lease_eventually(worker).await;
        let result = TrainResult {
            checkpoint: names::checkpoint(&model.name, 2),
            removed: vec![RemovedPerson {
                step: 2,
                trunk_saw_them: saw,
                ..<_>::default()
            }],
            ..<_>::default()
        };
        let ended = service.complete(&lease, job_result::Kind::Train(result));
        ended.await.expect("ends");
        let done = service.erasure_in(&begun.name, erasure::State::Done).await;
        let told = report(&done);
        let left = &told["models"][0];
        if !saw {
            assert!(left["retrained"].is_null(), "{told}");
            assert!(service.lease(worker).await.is_none(), "nothing is trained");
            continue;
        }
        let new = left["retrained"].as_str().expect("a new model");
        assert!(
            told["says"][0].as_str().is_some_and(|it| it.contains(new)),
            "{told}"
        );
        let lease = service.lease_eventually(worker).await;
        let order = lease.job.and_then(|it| it.spec).and_then(|it| it.kind);
        let Some(job_spec::Kind::Train(order)) = order else {
            panic!("{order:?}");
        };
        assert_eq!((&*order.model, &*order.leave), (new, ""));
        let trained = service
            .get_job(&stage.training)
            .await
            .spec
            .and_then(|it| it.kind);
        let Some(job_spec::Kind::Train(trained)) = trained else {
            panic!("{trained:?}");
        };
        assert_eq!(
            (order.seconds, order.steps),
            (trained.seconds, trained.steps)
        );
        let inputs = lease.inputs.expect("inputs");
        assert_eq!(
            (inputs.checkpoints.len(), inputs.shards.len()),
            (0, 1),
            "Bob alone"
        );
        let made = inputs.model.expect("a model");
        assert_eq!(made.display_name, "shared, trained anew");
        assert_eq!(
            (made.tier, made.variant),
            (model.tier.clone(), model.variant.clone())
        );
        assert_eq!(service.residue(TOKEN).await, [""; 0]);
    }
}

#[tokio::test]
async fn an_erasure_whose_job_fails_says_so_and_is_tried_again() {
    let stage = stage().await;
    let Stage {
        service,
        person,
        worker,
        ..
    } = &stage;
    let begun = service.erase(person).await;
    let lease = service.lease_eventually(worker).await;
    let failed = crate::support::job_error("LEAVING", "no such file");
    let failed = yoto_proto::worker::v1::end_job_request::Outcome::Failed(failed);
    service.end(&lease, failed).await.expect("ends");
    let told = service
        .erasure_in(&begun.name, erasure::State::Failed)
        .await;
    assert!(told.message.contains("no such file"), "{told:?}");
    let again = service.erase(person).await;
    assert_eq!(
        (&again.name, again.state()),
        (&begun.name, erasure::State::Running)
    );
    service.lease_eventually(worker).await;
}

#[tokio::test]
async fn a_person_who_is_alone_in_a_model_needs_no_worker() {
    let service = Service::start().await;
    let trained = service.trained().await;
    let done = service.erase(&trained.subject).await;
    let done = service.erasure_in(&done.name, erasure::State::Done).await;
    let told = report(&done);
    assert_eq!(told["models"][0]["shared_weights"], "deleted", "{told}");
    assert_eq!(service.checkpoints(&trained.model.name).await, []);
    assert!(!service.has(&format!("models/{}", id(&trained.model.name))));
    let request = GetJobRequest {
        name: job_name(&trained.training),
    };
    let training = service.jobs().get_job(request).await;
    assert_refused(training, Code::NotFound, "NOT_FOUND");
}

#[tokio::test]
async fn nobody_orders_what_takes_a_person_out() {
    let service = Service::start().await;
    let trained = service.trained().await;
    let order = yoto_proto::v1::TrainSpec {
        model: trained.model.name.clone(),
        leave: trained.subject.name.clone(),
        ..<_>::default()
    };
    let refused = service.create_job(job_spec::Kind::Train(order)).await;
    assert_invalid(refused, "spec.train.leave");
}
