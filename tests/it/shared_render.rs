//! Two workers draw one render. One of them is killed, and the other draws the rest of its range: every picture
//! exists once, with the same bytes as from a single worker.

use anyhow::{Context, ensure};
use yoto_client::YotoClient;
use yoto_proto::v1::job_attempt::Outcome;
use yoto_proto::v1::render_spec::What;
use yoto_proto::v1::{Job, Orbit, RenderSpec, RenderedFile, job, job_result};
use yoto_synthetic::SyntheticPerson;
use yoto_tests::jobs::until;
use yoto_tests::people::write_capture;
use yoto_tests::process::{Service, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");
const PICTURES: u32 = 120;

fn files(job: &Job) -> anyhow::Result<Vec<RenderedFile>> {
    match job.result.as_ref().and_then(|it| it.kind.as_ref()) {
        Some(job_result::Kind::Render(result)) => Ok(result.files.clone()),
        _ => anyhow::bail!("no result of a render: {job:?}"),
    }
}

/// Names and checksums.
fn sums(files: &[RenderedFile]) -> Vec<(&str, Option<&str>)> {
    (files.iter())
        .map(|it| (&*it.file, it.object.as_ref().map(|it| &*it.sha256)))
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn two_workers_draw_one_render_and_one_of_them_is_killed() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let capture = dir.path().join("ada");
    write_capture(&SyntheticPerson::cast(1, 7)[0], 8, 48, &capture)?;
    let service = Service::start(YOTO, &dir.path().join("data"), false)?;
    let mut first = service.worker(YOTO, "first")?;
    let run = |line: &str| {
        let mut arguments: Vec<&str> = line.split(' ').collect();
        arguments.extend(["--server", &service.address]);
        succeed(YOTO, &arguments)
    };
    let folder = capture.to_str().context("a path")?;
    run(&format!("subject add ada --capture {folder}"))?;
    run("train solo --subjects ada --tier draft --steps 20")?;
    let client = YotoClient::connect(&service.address).await?;
    let spec = RenderSpec {
        model: client.find_model("solo").await?.name,
        subject: client.find_subject("ada").await?.name,
        what: Some(What::Orbit(Orbit {
            frame: 0,
            views: PICTURES,
            size: 128,
        })),
        animate: true,
        ..RenderSpec::default()
    };
    let alone = client.create_render(spec.clone()).await?.name;
    let alone = until(&client, &alone, "the first render succeeded", |job| {
        job.state() == job::State::Succeeded
    })
    .await?;
    ensure!(alone.attempts.len() == 1, "{:?}", alone.attempts);

    let mut second = service.worker(YOTO, "second")?;
    second.line_with("registered")?;
    let job = client.create_render(spec).await?.name;
    let both = until(&client, &job, "two workers draw", |job| {
        let mut attempts = job.attempts.iter();
        job.outputs >= 12
            && attempts.all(|it| it.outcome() == Outcome::Running)
            && job.attempts.len() == 2
    })
    .await?;
    // The worker that asked first runs the render; the other one helps, and is killed.
    let helper = both.attempts.iter().find(|it| it.worker != both.worker);
    let helper = helper.context("a helper")?.worker_display_name.clone();
    let killed = if helper == "first" {
        &mut first
    } else {
        &mut second
    };
    killed.kill()?;
    let ended = until(&client, &job, "the render succeeded", |job| {
        job.state() == job::State::Succeeded
    })
    .await?;
    let outcomes: Vec<Outcome> = ended.attempts.iter().map(|it| it.outcome()).collect();
    assert_eq!(outcomes, [Outcome::Succeeded, Outcome::Lost]);

    let (together, alone) = (files(&ended)?, files(&alone)?);
    assert_eq!(together.len(), PICTURES as usize + 1);
    assert_eq!(sums(&together), sums(&alone), "the animation's too");
    // Each lease writes to a folder of its own.
    let id = job.trim_start_matches("jobs/");
    let leases = std::fs::read_dir(dir.path().join("data/objects/renders").join(id))?.count();
    assert_eq!(leases, 2, "both have drawn");
    Ok(())
}
