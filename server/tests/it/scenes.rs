//! Scenes with people of several models: each model must be able to show its people, and the checkpoints that a
//! scene uses are kept while it waits or is drawn.

use crate::support::{Service, assert_invalid, assert_refused, claim, id, job_name};
use tonic::{Code, Status};
use yoto_proto::keys;
use yoto_proto::v1::actor::Motion;
use yoto_proto::v1::render_quality::Want;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{
    Actor, CaptureMotion, DeleteCheckpointRequest, DeleteJobRequest, DeleteModelRequest, Job,
    Model, RemoveIdentityRequest, RenderQuality, RenderResult, RenderSpec, RenderedFile, Scene,
    Subject, job_result, job_spec,
};
use yoto_proto::worker::v1::{CommitOutputRequest, Lease, TakeRangeRequest};

/// Ada is in the models duo and fog; only duo is trained. Bob is in fog alone.
struct Stage {
    service: Service,
    ada: Subject,
    bob: Subject,
    duo: Model,
    fog: Model,
}

impl Stage {
    /// Models keep their newest checkpoint, the best one, and those in use.
    async fn new() -> Self {
        let service = Service::start_with(|config| {
            config.storage.keep_newest = 1;
            config.storage.keep_every = 0;
        })
        .await;
        let ada = service.ready_subject("Ada").await;
        let bob = service.ready_subject("Bob").await;
        let duo = service.model_of_tier("duo", "splat").await;
        let duo = service.joined(duo, &ada).await;
        let fog = service.joined(service.model("fog").await, &bob).await;
        let stage = Self {
            service,
            ada,
            bob,
            duo,
            fog,
        };
        stage.train(&stage.duo, 1, 20.0).await;
        stage
    }

    /// Trains a model up to a checkpoint at `step`.
    async fn train(&self, model: &Model, step: u64, psnr: f64) {
        self.service.train(model).await;
        let worker = self.service.worker(&["train"]).await;
        let lease = self.service.lease(&worker).await;
        let lease = lease.expect("the training waits");
        let published = self.service.publish_with(&lease, step, psnr).await;
        let checkpoint = published.expect("publishes");
        self.service.complete_training(&lease, &checkpoint).await;
    }

    /// A scene by duo with Ada, and another actor.
    fn spec(&self, other: Actor) -> RenderSpec {
        let ada = actor(&self.ada, "");
        RenderSpec {
            model: self.duo.name.clone(),
            what: Some(What::Scene(Scene {
                actors: vec![ada, other],
                width: 8,
                height: 8,
                ..Scene::default()
            })),
            ..RenderSpec::default()
        }
    }

    async fn order(&self, spec: RenderSpec) -> Result<Job, Status> {
        self.service.create_job(job_spec::Kind::Render(spec)).await
    }

    /// The order of a scene with Bob by fog.
    async fn scene(&self) -> Job {
        let bob = actor(&self.bob, &self.fog.name);
        self.order(self.spec(bob)).await.expect("is queued")
    }

    /// A new worker's lease of a render.
    async fn lease(&self, help: bool) -> Lease {
        let worker = self.service.worker(&["render"]).await;
        let lease = self.service.lease_or_help(&worker, "", help).await;
        lease.expect("the scene waits")
    }

    /// Steps of fog's checkpoints, newest first, and why they are kept.
    async fn kept(&self) -> Vec<(u64, String)> {
        let all = self.service.checkpoints(&self.fog.name).await.into_iter();
        all.map(|it| (it.step, it.kept_for.join(", "))).collect()
    }

    async fn complete(&self, lease: &Lease, other_checkpoints: Vec<String>) -> Result<(), Status> {
        let result = RenderResult {
            other_checkpoints,
            ..RenderResult::default()
        };
        let result = job_result::Kind::Render(result);
        self.service.complete(lease, result).await
    }
}

fn actor(subject: &Subject, model: &str) -> Actor {
    Actor {
        subject: subject.name.clone(),
        model: model.into(),
        motion: Some(Motion::Capture(CaptureMotion::default())),
        ..Actor::default()
    }
}

/// Names of the other models of a lease, each with the step to use.
fn others(lease: &Lease) -> Vec<(String, u64)> {
    let others = lease.inputs.iter().flat_map(|it| &it.other_models);
    let of = |it: &yoto_proto::worker::v1::OtherModel| {
        let model = it.model.clone().expect("a model");
        (model.name, it.checkpoints[0].step)
    };
    others.map(of).collect()
}

fn refused<T: std::fmt::Debug>(answer: Result<T, Status>, reason: &str, what: &str) {
    let message = answer.as_ref().expect_err("is refused").message();
    assert!(message.contains(what), "{message}");
    assert_refused(answer, Code::FailedPrecondition, reason);
}

#[tokio::test]
async fn what_a_model_can_t_show_is_refused_by_its_field() {
    let stage = Stage::new().await;
    let field = "spec.render.scene.actors[1].model";
    for name in ["fog", "jobs/fog"] {
        let answer = stage.order(stage.spec(actor(&stage.bob, name))).await;
        assert_invalid(answer, field);
    }
    let missing = stage.spec(actor(&stage.bob, "models/fog"));
    assert_refused(stage.order(missing).await, Code::NotFound, "NOT_FOUND");
    let of_fog = |subject| stage.spec(actor(subject, &stage.fog.name));
    let untrained = stage.order(of_fog(&stage.bob)).await;
    let said = "scene.actors[1].model: fog has no checkpoint";
    refused(untrained, "NO_CHECKPOINT", said);
    let stranger = stage.order(of_fog(&stage.ada)).await;
    let said = "scene.actors[1].subject: Ada is not in fog";
    refused(stranger, "NO_SLOT", said);
    stage.train(&stage.fog, 1, 20.0).await;
    let _ = stage.service.joined(stage.fog.clone(), &stage.ada).await;
    let late = stage.order(of_fog(&stage.ada)).await;
    let said = "scene.actors[1].subject: step 1 of fog was trained before Ada joined";
    refused(late, "NOT_TRAINED", said);

    let mut goal = of_fog(&stage.bob);
    let want = Some(Want::Tier("realtime".into()));
    goal.quality = Some(RenderQuality { want });
    let slow = stage.order(goal).await;
    let message = slow.as_ref().expect_err("fog has fields").message();
    assert!(
        message.contains("fog: the model's tier, draft"),
        "{message}"
    );
    assert_invalid(slow, "spec.render.quality");
    stage.scene().await;
}

#[tokio::test]
async fn what_a_scene_uses_of_another_model_stays_until_the_scene_has_ended() {
    let stage = Stage::new().await;
    let service = &stage.service;
    stage.train(&stage.fog, 10, 20.0).await;
    let scene = stage.scene().await;
    let delete = || {
        let request = DeleteModelRequest {
            name: stage.fog.name.clone(),
            ..<_>::default()
        };
        let mut models = service.models();
        async move { models.delete_model(request).await }
    };
    refused(delete().await, "MODEL_BUSY", &scene.name);
    // The checkpoint of the order is kept, although two better ones were published.
    stage.train(&stage.fog, 20, 30.0).await;
    stage.train(&stage.fog, 30, 30.5).await;
    let kept = [(30, "newest, best".to_owned()), (10, scene.name.clone())];
    assert_eq!(stage.kept().await, kept);
    let checkpoint = DeleteCheckpointRequest {
        name: format!("{}/checkpoints/10", stage.fog.name),
        ..<_>::default()
    };
    let busy = service.models().delete_checkpoint(checkpoint).await;
    refused(busy, "CHECKPOINT_BUSY", &scene.name);
    let untrained = service.joined(stage.fog.clone(), &stage.ada).await;
    let request = RemoveIdentityRequest {
        model: untrained.name.clone(),
        subject: stage.ada.name.clone(),
        ..<_>::default()
    };
    let busy = service.models().remove_identity(request).await;
    refused(busy, "MODEL_BUSY", &scene.name);

    // All workers of the scene use the checkpoint that was the best when it began.
    let lease = stage.lease(false).await;
    assert_eq!(others(&lease), [(stage.fog.name.clone(), 30)]);
    let request = TakeRangeRequest {
        claim: Some(claim(&lease)),
        pictures: 8,
        drawn: None,
    };
    let taken = service.workers().take_range(request).await;
    assert!(taken.expect("takes").into_inner().range.is_some());
    stage.train(&stage.fog, 40, 35.0).await;
    let helper = stage.lease(true).await;
    assert!(helper.helps);
    assert_eq!(others(&helper), others(&lease));

    refused(delete().await, "MODEL_BUSY", &scene.name);
    let for_it = |kept: Vec<(u64, String)>| -> Vec<u64> {
        let for_it = kept.iter().filter(|(_, why)| why.contains(&scene.name));
        for_it.map(|(step, _)| *step).collect()
    };
    assert_eq!(for_it(stage.kept().await), [30]);
    let used = format!("{}/checkpoints/30", stage.fog.name);
    stage.complete(&lease, vec![used]).await.expect("completes");
    assert_eq!(for_it(stage.kept().await), [0; 0]);
    delete().await.expect("nobody uses it");
    let kept = service.get_job(&scene.name).await;
    assert_eq!(kept.model, stage.duo.name, "the scene is duo's");
    let request = DeleteJobRequest {
        name: scene.name,
        ..<_>::default()
    };
    service.jobs().delete_job(request).await.expect("deletes");
}

#[tokio::test]
async fn a_scene_that_has_begun_goes_on_with_what_it_began_with() {
    let stage = Stage::new().await;
    stage.train(&stage.fog, 10, 20.0).await;
    stage.scene().await;
    let lease = stage.lease(false).await;
    let key = keys::render(id(&job_name(&lease)), lease.token, "000000.png");
    let request = CommitOutputRequest {
        claim: Some(claim(&lease)),
        file: Some(RenderedFile {
            file: "000000.png".into(),
            object: Some(stage.service.put(&key, b"picture").await),
        }),
    };
    let committed = stage.service.workers().commit_output(request).await;
    committed.expect("commits");
    stage.train(&stage.fog, 20, 30.0).await;
    let returned = yoto_proto::worker::v1::end_job_request::Outcome::Returned(<_>::default());
    stage.service.end(&lease, returned).await.expect("returns");
    let again = stage.lease(false).await;
    assert_eq!(others(&again), [(stage.fog.name.clone(), 10)]);
}

#[tokio::test]
async fn a_result_names_a_checkpoint_of_each_model() {
    let stage = Stage::new().await;
    stage.train(&stage.fog, 10, 20.0).await;
    stage.scene().await;
    let lease = stage.lease(false).await;
    let [duo, fog] = [&stage.duo, &stage.fog].map(|it| format!("{}/checkpoints/10", it.name));
    let extra = vec![fog.clone(), "fog".into()];
    for wrong in [vec![], vec![duo], vec![fog.clone(); 2], extra] {
        let answer = stage.complete(&lease, wrong).await;
        assert_invalid(answer, "result.render.other_checkpoints");
    }
    stage.complete(&lease, vec![fog]).await.expect("completes");
}
