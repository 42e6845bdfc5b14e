//! Estimated poses: found by the check, refined by the training, written to a file, and used by
//! renders.

use anyhow::{Context, ensure};
use yoto_capture::camera::{Camera, Pose};
use yoto_client::YotoClient;
use yoto_proto::pose_track::{Frame, PoseTrack};
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{MotionTransfer, RenderSpec, View, ViewList};
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::{write_capture, write_json};
use yoto_tests::process::{Run, Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const FRAMES: usize = 48;
const SIZE: u32 = 48;

/// Bytes of the picture of a render of `what`.
async fn rendered(client: &YotoClient, what: What) -> anyhow::Result<Vec<u8>> {
    let model = client.find_model("solo").await?.name;
    let subject = client.find_subject("ada").await?.name;
    let spec = RenderSpec {
        model,
        subject,
        what: Some(what),
        ..RenderSpec::default()
    };
    let job = client.create_render(spec).await?.name;
    let job = client.wait_for_job(&job, |_| ()).await?;
    let files = client.list_objects(&job.name).await?;
    let file = files.first().context("a picture")?;
    Ok(client.object(file).await?)
}

/// The frame at `index` of `track`, as a view.
fn view(track: &PoseTrack, index: usize) -> anyhow::Result<What> {
    let frame = &track.frames[index];
    let camera = Camera::from_frame(frame, track.image_size)?;
    Ok(What::Views(ViewList {
        views: vec![View {
            pose: Some(Pose::from_frame(frame)?.to_proto()),
            camera: Some(camera.to_proto()),
        }],
    }))
}

#[tokio::test(flavor = "multi_thread")]
async fn estimated_poses_are_refined_written_and_rendered() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let capture = dir.path().join("ada");
    let mut given = write_capture(&SyntheticPerson::cast(1, 7)[0], FRAMES, SIZE, &capture)?;
    for (i, frame) in (0..).zip(&mut given.frames) {
        let time = f64::from(i);
        frame.translation[0] += 0.05 * (0.9 * time).sin();
        frame.translation[1] += 0.05 * (0.7 * time).cos();
    }
    write_json(&capture.join("poses.json"), &serde_json::to_value(&given)?)?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let yoto = |line: &str, run: Run| service.ask(YOTO, line, run);
    let folder = capture.to_str().context("a path")?;
    yoto(&format!("subject add ada --capture {folder}"), succeed)?;
    let [out, sheet] = ["refined.json", "sheet.png"].map(|name| dir.path().join(name));
    let [file, sheet] = [&out, &sheet].map(|path| path.to_str().unwrap_or_default());

    // Nothing is refined if the user forbids it, and the output says so.
    yoto(
        "train plain --subjects ada --tier draft --steps 2 --refine-poses=never",
        succeed,
    )?;
    let poses = format!("subject poses ada --refined {file}");
    let said = yoto(&poses, fail)?;
    ensure!(said.contains("refined poses of"), "{said}");

    let said = yoto("train solo --subjects ada --tier draft --steps 60", succeed)?;
    ensure!(
        said.contains("ada: bodies wander") && said.contains("poses are refined"),
        "{said}"
    );
    let said = yoto(&poses, fail)?;
    ensure!(
        said.contains("plain, solo") || said.contains("solo, plain"),
        "{said}"
    );
    let more = format!("{poses} --model solo --sheet {sheet} --capture {folder}");
    yoto(&more, succeed)?;
    let written = PoseTrack::from_json(&std::fs::read(&out)?)
        .map_err(|found| anyhow::anyhow!("{found:?}"))?;
    let sheet = image::open(sheet)?;
    ensure!(sheet.width() > 6 * 256 && sheet.height() > 2 * 256);

    assert_eq!(written.skeleton.names, given.skeleton.names);
    let indices =
        |track: &PoseTrack| -> Vec<u32> { track.frames.iter().map(|frame| frame.index).collect() };
    assert_eq!(indices(&written), indices(&given));
    let pairs = given.frames.iter().zip(&written.frames);
    let far = |(a, b): &(&Frame, &Frame)| (a.translation[0] - b.translation[0]).abs() > 1e-4;
    ensure!(
        pairs.filter(far).count() > FRAMES / 2,
        "most frames were refined"
    );

    // The motion of a person is that of their refined poses.
    let client = YotoClient::connect(&service.address).await?;
    let model = client.find_model("solo").await?.name;
    let ada = client.find_subject("ada").await?.name;
    let refined = client.refined_poses(&model, &ada).await?;
    let index = 5;
    let motion = What::Motion(MotionTransfer {
        driver: ada,
        first_frame: Some(refined.frames[index].index),
        frame_count: 1,
        frame_step: 1,
        size: SIZE,
        ..MotionTransfer::default()
    });
    let shown = rendered(&client, motion).await?;
    let as_refined = rendered(&client, view(&refined, index)?).await?;
    let as_given = rendered(&client, view(&given, index)?).await?;
    ensure!(shown == as_refined, "the motion is not the refined one");
    ensure!(as_refined != as_given, "a change shows");
    Ok(())
}
