//! Faulty captures: each ends REJECTED with file, frame and field, and the service keeps running.

use anyhow::Context;
use yoto_client::{FileSource, YotoClient};
use yoto_proto::v1::job::State;
use yoto_proto::v1::subject;
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::write_capture;
use yoto_tests::process::{Service, fail, succeed};
use yoto_tests::upload::{Ingested, files, ingest};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const FRAMES: usize = 4;

#[tokio::test(flavor = "multi_thread")]
async fn a_corrupt_pose_track_or_mask_is_rejected_by_name_and_the_service_lives_on()
-> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let good = dir.path().join("good");
    write_capture(&SyntheticPerson::cast(1, 7)[0], FRAMES, 32, &good)?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let client = YotoClient::connect(&service.address).await?;

    let mut poses = files(&good)?;
    let track = std::fs::read_to_string(good.join("poses.json"))?;
    let mut json: serde_json::Value = serde_json::from_str(&track)?;
    json["frames"][2]["pose"][41] = serde_json::json!(1e30);
    let last = poses.last_mut().context("the pose track")?;
    last.source = FileSource::Memory(serde_json::to_vec(&json)?);
    let Ingested {
        subject, job, said, ..
    } = ingest(&client, "poses", poses).await?;
    assert!(
        said.iter()
            .any(|line| line.starts_with("poses.json frame 2: pose[41]: ")),
        "{said:?}"
    );
    assert_eq!(job.error.context("an error")?.code, "REJECTED");
    let state = client.get_subject(&subject).await?.state();
    assert_eq!(state, subject::State::Rejected);

    let mut masks = files(&good)?;
    let mask = masks
        .iter_mut()
        .find(|file| file.path == "masks/000003.png")
        .context("the mask")?;
    if let FileSource::Memory(bytes) = &mut mask.source {
        bytes.truncate(bytes.len() / 2);
    }
    let said = ingest(&client, "masks", masks).await?.said;
    assert!(
        said.iter()
            .any(|line| line.starts_with("masks/000003.png frame 3: ")),
        "{said:?}"
    );

    let mut gap = files(&good)?;
    gap.retain(|file| file.path != "frames/000001.png");
    let said = ingest(&client, "gap", gap).await?.said;
    assert!(
        said.iter()
            .any(|line| line.starts_with("frames/000001.png frame 1: ")),
        "{said:?}"
    );

    let Ingested {
        subject, job, said, ..
    } = ingest(&client, "good", files(&good)?).await?;
    assert_eq!((job.state(), said.len()), (State::Succeeded, 0), "{said:?}");
    assert_eq!(
        client.get_subject(&subject).await?.state(),
        subject::State::Ready
    );
    Ok(())
}

#[test]
fn the_command_line_names_what_is_wrong_before_anything_is_sent() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let capture = dir.path().join("ada");
    write_capture(&SyntheticPerson::cast(1, 7)[0], FRAMES, 32, &capture)?;
    let service = Service::start(YOTO, &dir.path().join("data"), false)?;
    let folder = capture.to_str().context("a path")?;
    let add = [
        "subject",
        "add",
        "ada",
        "--capture",
        folder,
        "--server",
        service.address.as_str(),
    ];

    let poses = capture.join("poses.json");
    let track = std::fs::read_to_string(&poses)?;
    let mut json: serde_json::Value = serde_json::from_str(&track)?;
    json["frames"][1]["K"][0][0] = serde_json::json!(-5.0);
    std::fs::write(&poses, serde_json::to_vec(&json)?)?;
    let said = fail(YOTO, &add)?;
    assert!(said.contains("poses.json frame 1: K: focal"), "{said}");

    std::fs::write(&poses, track)?;
    std::fs::remove_file(capture.join("masks/000002.png"))?;
    let said = fail(YOTO, &add)?;
    assert!(said.contains("masks/000002.png"), "{said}");

    // Files that users send instead of a capture.
    let at = |name: &str| dir.path().join(name).display().to_string();
    std::fs::create_dir(at("film"))?;
    std::fs::write(at("film/video.mp4"), "a film")?;
    std::fs::write(at("film.zip"), "a film")?;
    let (film, zip, motion) = (at("film"), at("film.zip"), at("walk.bvh"));
    for (line, reason) in [
        (
            ["subject", "add", "ada", &film],
            "poses.json: a capture needs the person's poses",
        ),
        (
            ["subject", "add", "ada", &zip],
            "film.zip: is not an archive",
        ),
        (["subject", "add", "ada", &motion], "there is no "),
        (
            ["job", "watch", "9f31c2aa", "--quiet"],
            "`yoto job list` lists them",
        ),
    ] {
        let address = service.address.strip_prefix("http://");
        let server = ["--server", address.context("an address")?];
        let said = fail(YOTO, &[&line[..], &server].concat())?;
        assert!(said.contains(reason), "{line:?}: {said}");
    }
    let said = fail(YOTO, &["motion", &motion])?;
    assert!(said.contains("there is no file"), "{said}");

    let listed = succeed(
        YOTO,
        &["subject", "list", "--server", service.address.as_str()],
    )?;
    assert!(!listed.contains("ada"), "nothing was made of it: {listed}");
    Ok(())
}
