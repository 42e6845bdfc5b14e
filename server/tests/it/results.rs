//! Results of workers, and their delivery to users.

use crate::support;
use crate::support::{Service, Trained, assert_invalid, assert_refused, id, job_name};
use futures::TryStreamExt;
use tonic::{Code, Status};
use yoto_proto::manifest::files;
use yoto_proto::v1::{
    Checkpoint, DownloadObjectRequest, GetRefinedPosesRequest, IngestResult, ListObjectsRequest,
    ObjectRef, RenderResult, RenderedFile, capture, job_result,
};
use yoto_proto::worker::v1::{Lease, PublishCheckpointRequest};
use yoto_proto::{keys, names};

#[tokio::test]
async fn a_worker_may_only_name_objects_of_its_own_lease() {
    let service = Service::start().await;
    let subject = service.subject("Ada").await;
    let capture = service.upload_good(&subject.name).await.name;
    let worker = service.worker(&["ingest"]).await;
    let lease = service.lease(&worker).await.expect("the ingest job waits");
    let result = |shard| {
        let result = IngestResult {
            notes: Vec::new(),
            shard: Some(shard),
            frames: 1,
            width: 1,
            height: 1,
            ..IngestResult::default()
        };
        job_result::Kind::Ingest(result)
    };
    let foreign = service.put("captures/other/shard.bin", b"shard").await;
    let answer = service.complete(&lease, result(foreign.clone())).await;
    assert_invalid(answer, "result.ingest.shard.key");
    let key = keys::shard(id(&capture), id(&job_name(&lease)), lease.token);
    let missing = ObjectRef {
        key: key.clone(),
        ..foreign
    };
    let answer = service.complete(&lease, result(missing)).await;
    assert_invalid(answer, "result.ingest.shard");
    let mut torn = service.put(&key, b"shard").await;
    torn.bytes += 1;
    assert_invalid(
        service.complete(&lease, result(torn)).await,
        "result.ingest.shard",
    );
    assert_eq!(
        service.get_capture(&capture).await.state(),
        capture::State::Ingesting
    );
    service.complete_ingest(&lease).await;
}

#[tokio::test]
async fn a_render_is_downloaded_from_a_job_that_succeeded() {
    let service = Service::start().await;
    let Trained {
        subject,
        model,
        worker,
        ..
    } = service.trained().await;
    let job = service.render(&model, &subject, "").await;
    let range = |file: &str, offset, length| {
        let request = DownloadObjectRequest {
            name: names::object(&job.name, file),
            offset,
            length,
        };
        let mut client = service.objects();
        async move {
            let answers = client.download_object(request).await?.into_inner();
            let chunks: Vec<_> = answers.map_ok(|answer| answer.chunk).try_collect().await?;
            Ok::<_, Status>(chunks.concat())
        }
    };
    let download = |file: &str| range(file, 0, 0);
    let early = download("000000.png").await;
    assert_refused(early, Code::NotFound, "NOT_FOUND");
    let lease = service.lease(&worker).await.expect("the render waits");
    assert_eq!(
        lease.inputs.clone().expect("has inputs").checkpoints.len(),
        1
    );
    let picture: Vec<u8> = (0..100_000_u32).map(|n| n as u8).collect();
    let key = keys::render(id(&job.name), lease.token, "000000.png");
    let object = Some(service.put(&key, &picture).await);
    let files = vec![RenderedFile {
        file: "000000.png".into(),
        object,
    }];
    let result = RenderResult {
        files,
        ..<_>::default()
    };
    service
        .complete(&lease, job_result::Kind::Render(result))
        .await
        .expect("completes");
    let list = |parent: &str| {
        let request = ListObjectsRequest {
            parent: parent.to_owned(),
            ..<_>::default()
        };
        let mut client = service.objects();
        async move { Ok::<_, Status>(client.list_objects(request).await?.into_inner().objects) }
    };
    let shown = service.get_job(&job.name).await.result;
    let Some(job_result::Kind::Render(shown)) = shown.and_then(|it| it.kind) else {
        panic!("a render has a result");
    };
    let object = shown.files[0].object.clone().expect("is described");
    assert_eq!(
        (&*object.key, object.bytes),
        ("", 100_000),
        "keys are not shown"
    );
    let listed = list(&job.name).await.expect("lists");
    assert_eq!(listed.len(), 1);
    assert_eq!(listed[0].name, names::object(&job.name, "000000.png"));
    assert_eq!((&*listed[0].file, listed[0].bytes), ("000000.png", 100_000));
    assert_invalid(list("subjects/1").await, "parent");
    assert_eq!(download("000000.png").await.expect("downloads"), picture);
    let png = "000000.png";
    assert_eq!(
        range(png, 70_000, 0).await.expect("a range"),
        picture[70_000..]
    );
    assert_eq!(range(png, 3, 5).await.expect("a range"), picture[3..8]);
    assert_eq!(range(png, 0, u64::MAX).await.expect("a range"), picture);
    assert!(
        range(png, 100_000, 0)
            .await
            .expect("nothing is left")
            .is_empty()
    );
    assert_invalid(range(png, 100_001, 0).await, "offset");
    assert_refused(download("../yoto.db").await, Code::NotFound, "NOT_FOUND");

    let mut altered = picture.clone();
    altered[70_000] ^= 1;
    std::fs::write(service.path(&key), &altered).expect("flips a bit");
    assert_refused(download(png).await, Code::DataLoss, "OBJECT_ALTERED");
    std::fs::write(service.path(&key), &picture[..70_000]).expect("tears");
    let torn = download(png).await;
    let message = torn.as_ref().expect_err("is torn").message().to_owned();
    assert!(!message.contains(&key), "{message}");
    assert_refused(torn, Code::DataLoss, "OBJECT_ALTERED");
}

/// Publishes a checkpoint of `step` with refined poses; the key of the poses.
async fn publish_poses(service: &Service, lease: &Lease, step: u64, poses: &[u8]) -> String {
    let model = lease.inputs.clone().and_then(|it| it.model);
    let model = model.expect("has a model").name;
    let job = support::job_name(lease);
    let folder = keys::checkpoint(id(&model), id(&job), lease.token, step);
    let file = files::refined_poses(0);
    let object = service.put(&format!("{folder}/{file}"), poses).await;
    let (key, bytes) = (object.key.clone(), object.bytes);
    let objects = vec![(&*file, object)];
    let manifest = service.manifest_of(&folder, step, objects).await;
    let checkpoint = Checkpoint {
        name: names::checkpoint(&model, step),
        step,
        manifest: Some(manifest),
        bytes,
        ..<_>::default()
    };
    let request = PublishCheckpointRequest {
        claim: Some(support::claim(lease)),
        checkpoint: Some(checkpoint),
        save_seconds: 0.5,
    };
    let published = service.workers().publish_checkpoint(request).await;
    published.expect("publishes");
    key
}

#[tokio::test]
async fn the_checkpoint_before_serves_refined_poses_when_a_bit_is_flipped() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let first = publish_poses(&service, &lease, 1, b"first").await;
    let second = publish_poses(&service, &lease, 2, b"second").await;
    let poses = async || {
        let request = GetRefinedPosesRequest {
            model: model.name.clone(),
            subject: ada.name.clone(),
        };
        let stream = service.models().get_refined_poses(request).await?;
        let chunks: Vec<_> = stream.into_inner().try_collect().await?;
        Ok::<_, Status>(
            chunks
                .into_iter()
                .flat_map(|it| it.chunk)
                .collect::<Vec<u8>>(),
        )
    };
    assert_eq!(poses().await.expect("are there"), b"second");
    std::fs::write(service.path(&second), b"tecond").expect("flips bits");
    assert_eq!(poses().await.expect("are there"), b"first");
    let folder = keys::folder(&first);
    std::fs::write(service.path(&format!("{folder}/manifest.json")), b"{").expect("tears");
    assert_refused(poses().await, Code::DataLoss, "OBJECT_ALTERED");
}

#[tokio::test]
async fn a_result_names_no_more_files_than_a_render_may_have() {
    let service = Service::start().await;
    let Trained {
        subject,
        model,
        worker,
        ..
    } = service.trained().await;
    service.render(&model, &subject, "").await;
    let lease = service.lease(&worker).await.expect("the render waits");
    let result = RenderResult {
        files: vec![RenderedFile::default(); 10_001],
        ..<_>::default()
    };
    let refused = service.complete(&lease, job_result::Kind::Render(result));
    assert_invalid(refused.await, "result.render.files");
    service.complete_render(&lease).await;
}

#[tokio::test]
async fn a_checkpoint_names_its_own_objects_and_all_of_them_exist() {
    let service = Service::start().await;
    let ada = service.ready_subject("Ada").await;
    let model = service.model_of(&ada).await;
    service.train(&model).await;
    let worker = service.worker(&["train"]).await;
    let lease = service.lease(&worker).await.expect("the training waits");
    let good = service.publish(&lease, 1).await.expect("is whole");
    let folder = |step| {
        let job = support::job_name(&lease);
        keys::checkpoint(id(&model.name), id(&job), lease.token, step)
    };
    let publish = async |step: u64, object: ObjectRef| {
        let objects = vec![(files::WEIGHTS, object)];
        let manifest = service.manifest_of(&folder(step), step, objects).await;
        let request = PublishCheckpointRequest {
            claim: Some(support::claim(&lease)),
            checkpoint: Some(Checkpoint {
                name: names::checkpoint(&model.name, step),
                step,
                manifest: Some(manifest),
                ..good.clone()
            }),
            save_seconds: 0.5,
        };
        service.workers().publish_checkpoint(request).await
    };
    let field = "checkpoint.manifest";
    // The first checkpoint's object stands for anybody's.
    let others = service.put(&format!("{}/x", folder(1)), b"x").await;
    assert_invalid(publish(2, others.clone()).await, field);
    let missing = ObjectRef {
        key: format!("{}/x", folder(2)),
        ..others.clone()
    };
    assert_invalid(publish(2, missing).await, field);
    let key = format!("{}/x", folder(2));
    let longer = ObjectRef {
        bytes: 2,
        ..service.put(&key, b"x").await
    };
    assert_invalid(publish(2, longer).await, field);
    let above = ObjectRef {
        key: format!("{}/../x", folder(2)),
        ..others
    };
    assert_invalid(publish(2, above).await, field);
    let altered = ObjectRef {
        sha256: yoto_proto::sha256_hex(b"y"),
        ..service.put(&key, b"x").await
    };
    assert_invalid(publish(2, altered).await, field);
    let whole = service.put(&key, b"x").await;
    publish(2, whole).await.expect("is whole");
}

/// What a worker writes after its checkpoint was published is not believed either.
#[tokio::test]
async fn a_manifest_that_names_others_objects_serves_none() {
    let service = Service::start().await;
    let Trained { checkpoint, .. } = service.trained().await;
    let listed = async |parent: &str| {
        let request = ListObjectsRequest {
            parent: parent.to_owned(),
            ..<_>::default()
        };
        service.objects().list_objects(request).await
    };
    let found = listed(&checkpoint.name).await.expect("is whole");
    assert_eq!(found.into_inner().objects.len(), 2);
    let manifest = checkpoint.manifest.expect("has one");
    let secret = service.put("uploads/c/video.mp4", b"a face").await;
    let folder = keys::folder(&manifest.key);
    let other = service
        .manifest_of(folder, checkpoint.step, vec![(files::WEIGHTS, secret)])
        .await;
    let row = format!(
        "UPDATE checkpoints SET manifest_bytes = {}, manifest_sha256 = '{}' WHERE manifest_key = '{}'",
        other.bytes, other.sha256, other.key
    );
    service.database.run(&row).await;
    let refused = listed(&checkpoint.name).await;
    assert_refused(refused, Code::FailedPrecondition, "CHECKPOINT_TORN");
}
