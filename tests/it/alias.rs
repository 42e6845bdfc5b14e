//! A render names its checkpoint by an alias, in the command and over HTTP.

use anyhow::{Context, ensure};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use yoto_client::YotoClient;
use yoto_proto::v1::{JobKind, job_result};
use yoto_synthetic::SyntheticPerson;
use yoto_tests::people::write_capture;
use yoto_tests::process::{PATIENCE, Run, Service, fail, succeed};

const YOTO: &str = env!("CARGO_BIN_EXE_yoto-under-test");

/// Posts `body` to the path of the service at `address`. Returns the status line and the JSON of the answer.
fn post(address: &str, path: &str, body: &Value) -> anyhow::Result<(String, Value)> {
    let host = address.trim_start_matches("http://");
    let mut connection = TcpStream::connect(host)?;
    connection.set_read_timeout(Some(PATIENCE))?;
    let body = body.to_string();
    // HTTP/1.0 has no chunks, and ends with the connection.
    write!(
        connection,
        "POST {path} HTTP/1.0\r\nhost: {host}\r\ncontent-type: application/json\r\ncontent-length: {}\r\n\r\n{body}",
        body.len()
    )?;
    let mut answer = String::new();
    connection.read_to_string(&mut answer)?;
    let (head, body) = answer.split_once("\r\n\r\n").context("no body")?;
    let status = head.lines().next().unwrap_or_default().to_owned();
    Ok((status, serde_json::from_str(body).context(answer.clone())?))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_checkpoint_is_rendered_by_its_alias() -> anyhow::Result<()> {
    let dir = tempfile::tempdir()?;
    let at = |name: &str| dir.path().join(name).display().to_string();
    let capture = dir.path().join("ada");
    write_capture(&SyntheticPerson::cast(1, 7)[0], 8, 24, &capture)?;
    let service = Service::start(YOTO, &dir.path().join("data"), true)?;
    let yoto = |line: &str, run: Run| service.ask(YOTO, line, run);
    yoto(&format!("subject add ada {}", at("ada")), succeed)?;
    yoto("train solo --subjects ada --tier draft --steps 2", succeed)?;
    yoto("model alias solo prod --checkpoint 2", succeed)?;
    // Without a checkpoint by name, a render uses a later one.
    yoto("train solo --steps 1", succeed)?;

    let render = |alias: &str, out: &str| {
        let out = at(out);
        format!(
            "render solo --subject ada --orbit 0 --views 2 --size 16 --checkpoint {alias} --out {out}"
        )
    };
    yoto(&render("prod", "prod"), succeed)?;
    ensure!(dir.path().join("prod/000001.png").exists());
    let client = YotoClient::connect(&service.address).await?;
    let model = client.find_model("solo").await?.name;
    let subject = client.find_subject("ada").await?.name;
    let second = format!("{model}/checkpoints/2");
    let jobs = client.list_jobs().await?;
    let rendered = jobs.iter().find(|it| it.kind() == JobKind::Render);
    let result = rendered.and_then(|it| it.result.clone()?.kind);
    let Some(job_result::Kind::Render(result)) = result else {
        anyhow::bail!("no result of a render: {rendered:?}");
    };
    ensure!(result.checkpoint == second, "{}", result.checkpoint);
    let refused = yoto(&render("none", "none"), fail)?;
    ensure!(refused.contains("[NOT_FOUND]"), "{refused}");

    let order = |alias: &str| {
        let checkpoint = format!("{model}/checkpoints/{alias}");
        json!({"spec": {
            "model": model,
            "subject": subject,
            "checkpoint": checkpoint,
            "orbit": {"frame": 0, "views": 1, "size": 16},
        }})
    };
    let (status, job) = post(&service.address, "/v1/renders", &order("prod"))?;
    ensure!(status.contains(" 200 "), "{status}: {job}");
    let ordered = &job["spec"]["render"]["checkpoint"];
    ensure!(*ordered == second.as_str(), "{job}");
    let (status, problem) = post(&service.address, "/v1/renders", &order("none"))?;
    ensure!(status.contains(" 404 "), "{status}: {problem}");
    Ok(())
}
