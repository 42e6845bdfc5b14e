//! The catalogue over gRPC: request ids, pages, slots, and the requirements of queued jobs.

use crate::support::{Service, assert_invalid, assert_refused};
use tonic::Code;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    AddIdentityRequest, CreateJobRequest, CreateModelRequest, CreateRenderRequest,
    CreateSubjectRequest, GetModelRequest, GetSubjectRequest, IngestSpec, JobSpec,
    ListCheckpointsRequest, ListJobsRequest, ListSubjectsRequest, Orbit, RemoveIdentityRequest,
    RenderSpec, Subject, TrainSpec, job_spec,
};

#[tokio::test]
async fn a_request_id_gets_one_answer_and_serves_one_body() {
    let service = Service::start().await;
    let request = CreateSubjectRequest {
        display_name: "Ada".into(),
        consent_note: "signed".into(),
        request_id: "r-1".into(),
        validate_only: false,
    };
    let mut client = service.subjects();
    let first = client
        .create_subject(request.clone())
        .await
        .expect("creates")
        .into_inner();
    let again = client
        .create_subject(request.clone())
        .await
        .expect("repeats")
        .into_inner();
    assert_eq!(first, again);
    let other = CreateSubjectRequest {
        display_name: "Bob".into(),
        ..request
    };
    let answer = client.create_subject(other).await;
    assert_refused(answer, Code::AlreadyExists, "REQUEST_ID_REUSED");
    let request = ListSubjectsRequest::default();
    let listed = client
        .list_subjects(request)
        .await
        .expect("lists")
        .into_inner()
        .subjects;
    assert_eq!(listed, [first]);

    let subject = service.ready_subject("Cleo").await;
    let model = service.model_of(&subject).await;
    let train = |seconds| CreateJobRequest {
        spec: Some(JobSpec {
            kind: Some(job_spec::Kind::Train(TrainSpec {
                model: model.name.clone(),
                seconds,
                ..<_>::default()
            })),
        }),
        request_id: "r-1".into(),
        ..<_>::default()
    };
    let mut client = service.jobs();
    let first = client
        .create_job(train(1.0))
        .await
        .expect("creates")
        .into_inner();
    let again = client
        .create_job(train(1.0))
        .await
        .expect("repeats")
        .into_inner();
    assert_eq!(first, again);
    let answer = client.create_job(train(2.0)).await;
    assert_refused(answer, Code::AlreadyExists, "REQUEST_ID_REUSED");
}

#[tokio::test]
async fn pages_follow_each_other_without_gap_or_repeat() {
    let service = Service::start().await;
    for n in 0..5 {
        service.subject(&format!("person {n}")).await;
    }
    let (mut names, mut token, mut pages) = (Vec::new(), String::new(), 0);
    loop {
        let request = ListSubjectsRequest {
            page_size: 2,
            page_token: token.clone(),
        };
        let page = service
            .subjects()
            .list_subjects(request)
            .await
            .expect("lists")
            .into_inner();
        names.extend(
            page.subjects
                .into_iter()
                .map(|subject| subject.display_name),
        );
        token = page.next_page_token;
        pages += 1;
        if token.is_empty() {
            break;
        }
        let foreign = ListJobsRequest {
            page_size: 2,
            page_token: token.clone(),
            ..<_>::default()
        };
        assert_invalid(service.jobs().list_jobs(foreign).await, "page_token");
    }
    let expected: Vec<_> = (0..5).map(|n| format!("person {n}")).collect();
    assert_eq!((names, pages), (expected, 3));
    let request = ListSubjectsRequest {
        page_size: -1,
        ..<_>::default()
    };
    assert_invalid(service.subjects().list_subjects(request).await, "page_size");
}

#[tokio::test]
async fn names_and_fields_that_are_none_are_refused() {
    let service = Service::start().await;
    for name in [
        "subjects/../x",
        "subjects/",
        "models/a",
        "subjects/a' OR 1=1",
    ] {
        let request = GetSubjectRequest { name: name.into() };
        assert_invalid(service.subjects().get_subject(request).await, "name");
    }
    let request = GetSubjectRequest {
        name: "subjects/none".into(),
    };
    let answer = service.subjects().get_subject(request).await;
    assert_refused(answer, Code::NotFound, "NOT_FOUND");
    let request = CreateSubjectRequest::default();
    assert_invalid(
        service.subjects().create_subject(request).await,
        "display_name",
    );
    let model = |tier: &str, variant: &str| CreateModelRequest {
        display_name: "m".into(),
        tier: tier.into(),
        variant: variant.into(),
        ..<_>::default()
    };
    assert_invalid(
        service.models().create_model(model("huge", "yoto")).await,
        "tier",
    );
    assert_invalid(
        service.models().create_model(model("fast", "nerf")).await,
        "variant",
    );
}

#[tokio::test]
async fn a_subject_gets_one_slot_a_model_and_slots_count_up() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let bob = service.ready_subject("Bob").await;
    let (one, other) = (service.model("one").await, service.model("other").await);
    let slot = |model: &str, subject: &str| {
        let request = AddIdentityRequest {
            model: model.into(),
            subject: subject.into(),
            ..<_>::default()
        };
        let mut client = service.models();
        async move {
            client
                .add_identity(request)
                .await
                .map(|answer| answer.into_inner().slot)
        }
    };
    assert_eq!(slot(&one.name, &ada.name).await.expect("fits"), 0);
    assert_eq!(slot(&one.name, &bob.name).await.expect("fits"), 1);
    assert_eq!(slot(&one.name, &ada.name).await.expect("has one"), 0);
    assert_eq!(slot(&other.name, &bob.name).await.expect("fits"), 0);
    let request = GetModelRequest {
        name: one.name.clone(),
    };
    let model = service
        .models()
        .get_model(request)
        .await
        .expect("is there")
        .into_inner();
    let slots: Vec<_> = model
        .slots
        .iter()
        .map(|slot| (slot.slot, slot.subject.clone()))
        .collect();
    assert_eq!(slots, [(0, ada.name.clone()), (1, bob.name.clone())]);

    let raw = service.subject("no capture").await;
    let answer = slot(&one.name, &raw.name).await;
    assert_refused(answer, Code::FailedPrecondition, "SUBJECT_NOT_READY");
    let request = CreateModelRequest {
        display_name: "single".into(),
        tier: "draft".into(),
        variant: "humannerf".into(),
        ..<_>::default()
    };
    let single = service
        .models()
        .create_model(request)
        .await
        .expect("creates")
        .into_inner();
    assert_eq!(slot(&single.name, &ada.name).await.expect("fits"), 0);
    let answer = slot(&single.name, &bob.name).await;
    assert_refused(answer, Code::FailedPrecondition, "MODEL_FULL");
}

#[tokio::test]
async fn a_job_is_refused_while_the_catalogue_cannot_serve_it() {
    let service = Service::start().await;
    let empty = service.model("empty").await;
    let train = |model: &str, seconds| {
        let spec = TrainSpec {
            model: model.into(),
            seconds,
            ..<_>::default()
        };
        job_spec::Kind::Train(spec)
    };
    let answer = service.create_job(train(&empty.name, 1.0)).await;
    assert_refused(answer, Code::FailedPrecondition, "NO_IDENTITIES");
    let answer = service.create_job(train("models/none", 1.0)).await;
    assert_refused(answer, Code::NotFound, "NOT_FOUND");
    assert_invalid(
        service.create_job(train("none", 1.0)).await,
        "spec.train.model",
    );
    assert_invalid(
        service.create_job(train(&empty.name, f64::NAN)).await,
        "spec.train.seconds",
    );
    // A draft has a field.
    let shiny = job_spec::Kind::Train(TrainSpec {
        model: empty.name.clone(),
        harmonics: Some(2),
        ..<_>::default()
    });
    assert_invalid(service.create_job(shiny).await, "spec.train.harmonics");
    let ingest = job_spec::Kind::Ingest(IngestSpec {
        capture: "captures/a".into(),
    });
    assert_invalid(service.create_job(ingest).await, "spec.ingest");

    let ada = service.ready_subject("Ada").await;
    let bob = service.ready_subject("Bob").await;
    let model = service.model_of(&ada).await;
    let render = |subject: &str| CreateRenderRequest {
        spec: Some(RenderSpec {
            model: model.name.clone(),
            subject: subject.into(),
            what: Some(What::Orbit(Orbit {
                frame: 0,
                views: 4,
                size: 32,
            })),
            ..<_>::default()
        }),
        ..<_>::default()
    };
    let mut client = service.renders();
    let answer = client.create_render(render(&ada.name)).await;
    assert_refused(answer, Code::FailedPrecondition, "NO_CHECKPOINT");
    let answer = client.create_render(render(&bob.name)).await;
    assert_refused(answer, Code::FailedPrecondition, "NO_SLOT");
    assert_invalid(
        client.create_render(CreateRenderRequest::default()).await,
        "spec",
    );

    let worker = service.worker(&["train"]).await;
    service.train_to(&model, &worker, 7).await;
    let request = ListCheckpointsRequest {
        model: model.name.clone(),
        ..<_>::default()
    };
    let listed = service
        .models()
        .list_checkpoints(request)
        .await
        .expect("lists")
        .into_inner();
    assert_eq!(listed.checkpoints.len(), 1);
    assert_eq!(listed.checkpoints[0].manifest, None, "keys have tokens");
    client
        .create_render(render(&ada.name))
        .await
        .expect("can be served now");
}

#[tokio::test(flavor = "multi_thread")]
async fn fifty_writers_at_once_all_get_through_and_a_shared_request_id_creates_one() {
    let service = Service::start().await;
    let writes = (0..50).map(|n| {
        let request_id = if n % 2 == 0 {
            "shared".into()
        } else {
            format!("own-{n}")
        };
        let request = CreateSubjectRequest {
            display_name: "Ada".into(),
            consent_note: String::new(),
            request_id,
            validate_only: false,
        };
        let mut client = service.subjects();
        async move {
            client
                .create_subject(request)
                .await
                .expect("gets through")
                .into_inner()
                .name
        }
    });
    let names = futures::future::join_all(writes).await;
    let shared: std::collections::HashSet<_> = names.iter().step_by(2).collect();
    assert_eq!(shared.len(), 1);
    let all: std::collections::HashSet<_> = names.iter().collect();
    assert_eq!(all.len(), 26);
    let request = ListSubjectsRequest::default();
    let listed = service
        .subjects()
        .list_subjects(request)
        .await
        .expect("lists")
        .into_inner();
    assert_eq!(listed.subjects.len(), 26);
}

#[tokio::test]
async fn a_person_leaves_a_model_that_was_not_trained_with_them() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let bob = service.ready_subject("Bob").await;
    let model = service.model_of(&ada).await;
    assert!(!model.slots[0].trained, "nobody is yet");
    let worker = service.worker(&["train"]).await;
    let (training, checkpoint) = service.train_to(&model, &worker, 1).await;
    let join = AddIdentityRequest {
        model: model.name.clone(),
        subject: bob.name.clone(),
        ..<_>::default()
    };
    let slot = service.models().add_identity(join.clone()).await;
    assert_eq!(slot.expect("joins").into_inner().slot, 1);
    let remove = |subject: &Subject| {
        let request = RemoveIdentityRequest {
            model: model.name.clone(),
            subject: subject.name.clone(),
            ..<_>::default()
        };
        let mut client = service.models();
        async move { client.remove_identity(request).await }
    };
    // A training may be about to publish a checkpoint with them.
    assert_refused(remove(&bob).await, Code::FailedPrecondition, "MODEL_BUSY");
    service.complete_training(&training, &checkpoint).await;
    assert_refused(remove(&ada).await, Code::FailedPrecondition, "SLOT_TRAINED");
    let left = remove(&bob).await.expect("leaves").into_inner();
    assert_eq!(left.slots.len(), 1);
    assert!(left.slots[0].trained);
    assert_refused(remove(&bob).await, Code::NotFound, "NOT_FOUND");
    let again = service
        .models()
        .add_identity(join)
        .await
        .expect("joins again");
    assert_eq!(again.into_inner().slot, 2, "numbers are not used again");
}

#[tokio::test]
async fn text_with_hidden_characters_is_refused() {
    let service = Service::start().await;
    let create = |display_name: &str, consent_note: &str| {
        let (mut subjects, request) = (
            service.subjects(),
            CreateSubjectRequest {
                display_name: display_name.into(),
                consent_note: consent_note.into(),
                ..<_>::default()
            },
        );
        async move { subjects.create_subject(request).await }
    };
    let clipboard = "signed \u{1b}]52;c;aGk=\u{7}";
    assert_invalid(create("Ada", clipboard).await, "consent_note");
    assert_invalid(create("Ada", &"x".repeat(10_001)).await, "consent_note");
    assert_invalid(create("\u{202e}adA", "").await, "display_name");
    create("Ada", "signed on paper,\nkept in the safe")
        .await
        .expect("lines may break");
}
