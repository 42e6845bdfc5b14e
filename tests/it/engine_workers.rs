//! Workers as engines start them: for one job, until no job comes, and on machines that are taken back at short notice.

use anyhow::{Context, ensure};
use std::path::Path;
use yoto_client::YotoClient;
use yoto_proto::v1::job::State;
use yoto_proto::v1::job_attempt::Outcome;
use yoto_proto::v1::{Job, TrainSpec, subject};
use yoto_synthetic::SyntheticPerson;
use yoto_tests::jobs::until;
use yoto_tests::people::write_capture;
use yoto_tests::process::{Process, Service, output, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");

/// The arguments of a worker of `service`.
fn worker<'a>(service: &'a Service, scratch: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let own = [
        "worker",
        "--service",
        service.address.as_str(),
        "--objects",
        service.objects.as_str(),
        "--scratch",
        scratch,
    ];
    [&own[..], more].concat()
}

/// Uploads a capture of Ada without a wait for its ingest.
fn upload(service: &Service, dir: &Path) -> anyhow::Result<()> {
    let capture = dir.join("ada");
    write_capture(&SyntheticPerson::cast(1, 7)[0], 8, 48, &capture)?;
    let capture = capture.to_str().context("a path")?;
    let add = ["subject", "add", "ada", capture, "--no-wait", "--server"];
    succeed(YOTO, &[&add[..], &[service.address.as_str()]].concat())?;
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_for_one_job_says_how_it_went_and_an_idle_one_ends() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let service = Service::start(YOTO, &dir.path().join("data"), false)?;
    let scratch = dir.path().join("scratch");
    let scratch = scratch.to_str().context("a path")?;
    let ends = |more: &[&str]| -> anyhow::Result<(Option<i32>, String)> {
        let ended = output(YOTO, &worker(&service, scratch, more))?;
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        Ok((ended.status.code(), said))
    };
    let (code, said) = ends(&["--one-job"])?;
    ensure!(
        code == Some(3) && said.contains("there is no job"),
        "{said}"
    );
    let (code, said) = ends(&["--max-idle", "0.5"])?;
    ensure!(code == Some(0) && said.contains("no job came"), "{said}");

    upload(&service, dir.path())?;
    // A render's worker does not take an upload.
    let (code, said) = ends(&["--one-job", "--kinds", "render"])?;
    ensure!(code == Some(3), "{said}");
    let (code, said) = ends(&["--one-job", "--needs", "cpu"])?;
    ensure!(
        code == Some(0) && said.contains("the job succeeded"),
        "{said}"
    );
    let client = YotoClient::connect(&service.address).await?;
    let subject = client.find_subject("ada").await?;
    ensure!(subject.state() == subject::State::Ready, "{subject:?}");
    let (code, said) = ends(&["--one-job", "--max-idle", "0.5"])?;
    ensure!(code == Some(3), "{said}");
    Ok(())
}

#[test]
fn a_worker_that_can_not_work_says_why_in_a_line() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let objects = format!("file://{}/", dir.path().display());
    let scratch = dir.path().join("scratch");
    let scratch = scratch.to_str().context("a path")?;
    let told = |more: &[&str]| -> anyhow::Result<String> {
        let own = [
            "worker",
            "--objects",
            objects.as_str(),
            "--scratch",
            scratch,
        ];
        let ended = output(YOTO, &[&own[..], more].concat())?;
        ensure!(ended.status.code() == Some(1), "{more:?}: {}", ended.status);
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        let error = said.lines().find(|it| it.starts_with("error: "));
        Ok(error
            .with_context(|| format!("no error in {said}"))?
            .to_owned())
    };
    // Nothing listens at either address.
    let gone = "http://127.0.0.1:1,http://127.0.0.1:2";
    let silent = told(&["--service", gone, "--max-idle", "1"])?;
    ensure!(
        silent.contains("no coordinator of the service has answered for 1 s"),
        "{silent}"
    );
    let bad = told(&["--service", "ftp://a:1"])?;
    ensure!(bad.contains("http://"), "{bad}");
    let nothing = told(&["--needs", "gpu", "--kinds", "ingest"])?;
    ensure!(nothing.contains("--kinds and --needs"), "{nothing}");
    Ok(())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_worker_of_a_service_with_two_addresses_uses_the_one_that_answers() -> anyhow::Result<()>
{
    let dir = tempfile::tempdir()?;
    let service = Service::start(YOTO, &dir.path().join("data"), false)?;
    let scratch = dir.path().join("scratch");
    let scratch = scratch.to_str().context("a path")?;
    // Whichever it begins with.
    for both in [
        format!("http://127.0.0.1:1,{}", service.address),
        format!("{},http://127.0.0.1:1", service.address),
    ] {
        let own = [
            "worker",
            "--service",
            both.as_str(),
            "--objects",
            service.objects.as_str(),
        ];
        let ended = output(
            YOTO,
            &[&own[..], &["--scratch", scratch, "--one-job"]].concat(),
        )?;
        ensure!(ended.status.code() == Some(3), "{ended:?}");
        succeed(YOTO, &["job", "list", "--service", &both])?;
    }
    Ok(())
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread")]
async fn a_training_on_a_machine_that_is_taken_back_saves_and_is_not_charged() -> anyhow::Result<()>
{
    let dir = tempfile::tempdir()?;
    let service = Service::start(YOTO, &dir.path().join("data"), false)?;
    let scratch = dir.path().join("scratch");
    let scratch = scratch.to_str().context("a path")?;
    upload(&service, dir.path())?;
    let ingest = worker(&service, scratch, &["--one-job"]);
    succeed(YOTO, &ingest)?;
    let create = [
        "model",
        "create",
        "solo",
        "--subjects",
        "ada",
        "--tier",
        "draft",
    ];
    succeed(
        YOTO,
        &[&create[..], &["--server", service.address.as_str()]].concat(),
    )?;
    let client = YotoClient::connect(&service.address).await?;
    let model = client.find_model("solo").await?.name;
    let spec = TrainSpec {
        model: model.clone(),
        steps: 1_000_000,
        // No checkpoint comes before the notice.
        checkpoint_seconds: 10_000.0,
        ..TrainSpec::default()
    };
    let job = client.train(spec).await?.name;

    let mut taken = Process::start(YOTO, &worker(&service, scratch, &["--notice", "60"]))?;
    let is_training = |job: &Job| job.progress.as_ref().is_some_and(|it| it.step > 0);
    until(&client, &job, "it trains", is_training).await?;
    terminate(&taken)?;
    let status = taken.wait()?;
    ensure!(status.success(), "{status}");
    let returned = until(&client, &job, "it is back", |it| {
        it.state() == State::Queued
    })
    .await?;
    let checkpoint = client.list_checkpoints(&model).await?;
    let step = checkpoint.first().context("it has saved")?.step;
    ensure!(step > 0);
    let ends: Vec<Outcome> = returned.attempts.iter().map(|it| it.outcome()).collect();
    assert_eq!((ends, returned.lost_workers), (vec![Outcome::Returned], 0));

    // The next worker goes on from there, and gives the job back too, saved or as it was.
    let mut second = Process::start(YOTO, &worker(&service, scratch, &["--notice", "8"]))?;
    second.line_with("training resumes")?;
    terminate(&second)?;
    ensure!(second.wait()?.success());
    let returned = until(&client, &job, "it is back", |it| {
        it.state() == State::Queued
    })
    .await?;
    assert_eq!((returned.attempts.len(), returned.lost_workers), (2, 0));
    Ok(())
}

/// Sends SIGTERM.
#[cfg(unix)]
fn terminate(process: &Process) -> anyhow::Result<()> {
    succeed("kill", &["-TERM", &process.id().to_string()])?;
    Ok(())
}
