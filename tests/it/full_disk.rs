//! Full disks. A training whose files can't be written at its end waits, says why, and is saved as soon as the folder
//! can be written, without a step made twice. A service whose log can't be written goes on.

use anyhow::{Context, ensure};
use std::fs;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use yoto_client::YotoClient;
use yoto_proto::v1::job::State;
use yoto_proto::v1::job_result::Kind;
use yoto_proto::v1::{Job, TrainSpec};
use yoto_synthetic::SyntheticPerson;
use yoto_tests::jobs::until;
use yoto_tests::people::write_capture;
use yoto_tests::process::{PATIENCE, Service, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const STEPS: u64 = 60;

#[tokio::test(flavor = "multi_thread")]
async fn a_trained_model_waits_for_a_disk_that_takes_it() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let (capture, data) = (dir.path().join("ada"), dir.path().join("data"));
    write_capture(&SyntheticPerson::cast(1, 7)[0], 8, 48, &capture)?;
    let service = Service::start(YOTO, &data, true)?;
    let server = ["--server", service.address.as_str()];
    let capture = capture.to_str().context("a path")?;
    succeed(
        YOTO,
        &[&["subject", "add", "ada", capture], &server[..]].concat(),
    )?;
    let model = [
        "model",
        "create",
        "solo",
        "--subjects",
        "ada",
        "--tier",
        "draft",
    ];
    succeed(YOTO, &[&model, &server[..]].concat())?;

    let client = YotoClient::connect(&service.address).await?;
    let model = client.find_model("solo").await?.name;
    let spec = TrainSpec {
        model,
        steps: STEPS,
        seed: 3,
        ..TrainSpec::default()
    };
    let name = client.train(spec).await?.name;
    let steps = |job: &Job| job.progress.as_ref().map_or(0, |it| it.step);
    until(&client, &name, "a step was taken", |job| steps(job) > 0).await?;
    // A folder in which no user can write, not even root.
    let (scratch, away) = (data.join("scratch"), data.join("away"));
    fs::rename(&scratch, &away)?;
    let phase = |job: &Job| job.progress.as_ref().map(|it| it.phase.clone());
    let waiting = until(&client, &name, "it waits to save", |job| {
        phase(job).is_some_and(|it| it.starts_with("waiting to save: ")) || job.end_time.is_some()
    })
    .await?;
    ensure!(waiting.state() == State::Running, "{waiting:?}");
    let said = phase(&waiting).context("a phase")?;
    ensure!(said.contains("scratch"), "it says where: {said}");
    ensure!(steps(&waiting) == STEPS, "{waiting:?}");

    fs::rename(&away, &scratch)?;
    let ended = until(&client, &name, "it has ended", |job| job.end_time.is_some()).await?;
    ensure!(
        ended.state() == State::Succeeded && ended.attempts.len() == 1,
        "{ended:?}"
    );
    let Some(Kind::Train(result)) = ended.result.and_then(|it| it.kind) else {
        anyhow::bail!("no result of a training");
    };
    ensure!(result.steps == STEPS, "each step was made once: {result:?}");
    Ok(())
}

#[cfg(target_os = "linux")]
#[tokio::test]
async fn a_service_goes_on_where_its_log_can_t_be_written() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let port = std::net::TcpListener::bind("127.0.0.1:0")?
        .local_addr()?
        .port();
    let address = format!("127.0.0.1:{port}");
    let full = fs::OpenOptions::new().write(true).open("/dev/full")?;
    let mut service = Command::new(YOTO)
        .args(["serve", "--no-worker", "--listen", &address, "--data"])
        .arg(dir.path().join("data"))
        .env("RUST_LOG", "debug")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(full)
        .spawn()?;
    let began = Instant::now();
    let server = format!("http://{address}");
    // The process must not outlive a failed test.
    let answered = async {
        loop {
            if let Ok(client) = YotoClient::connect(&server).await {
                client.create_subject("Ada", "").await?;
                return anyhow::Ok(());
            }
            if let Some(status) = service.try_wait()? {
                anyhow::bail!("it has ended: {status}");
            }
            ensure!(began.elapsed() < PATIENCE, "it never answers");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
    .await;
    let ended = service.try_wait();
    service.kill()?;
    service.wait()?;
    answered?;
    let ended = ended?;
    ensure!(ended.is_none(), "it has ended: {ended:?}");
    Ok(())
}
