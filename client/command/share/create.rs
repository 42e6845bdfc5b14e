//! `yoto share create`.

use crate::args::span::span;
use crate::args::{QueueArgs, Server};
use crate::show::now;
use crate::waiting::wait_for_new;
use anyhow::Context;
use clap::Args;
use prost_types::Timestamp;
use qrcode::QrCode;
use qrcode::render::unicode::Dense1x2;
use std::time::Duration;
use yoto_client::YotoClient;
use yoto_proto::v1::{CreateShareRequest, ExportForm, ExportSpec};
use yoto_terminal::output;
use yoto_terminal::progress::ProgressDisplay;

const AFTER_HELP: &str = "\
Exports the person's page, which plays the motion of their own capture, and makes a link to it. The link is the only
line on stdout, and is shown once: the service keeps its SHA-256. With --job, the link shows the page of an export
that was made before (`yoto export` prints its job), with the motions that were chosen for it. The link begins with the
address of --server, or with --at: it works for everybody who can reach that address.

Examples:
  yoto share create duo --subject ada --expires 30d --note \"for Bob\"
  yoto share create --job 8c14e2a0 --embed --at https://people.example";

/// Make a link to a page that plays a person, and print it once.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(super) struct Create {
    /// The model, by name.
    #[arg(required_unless_present = "job", requires = "subject")]
    model: Option<String>,
    /// The person, by name.
    #[arg(long, value_name = "NAME", requires = "model")]
    subject: Option<String>,
    /// Export job whose page the link shows, by id, in place of a new export.
    #[arg(long, value_name = "ID", conflicts_with_all = ["model", "subject"])]
    job: Option<String>,
    /// Time until the link ends, such as 90d, 12h or 30m [default: never].
    #[arg(long, value_name = "TIME", value_parser = span)]
    expires: Option<Duration>,
    /// Note about the link, in one line, such as the person who gets it.
    #[arg(long, value_name = "TEXT", default_value = "")]
    note: String,
    /// Let other sites show the page in a frame, and the person in the element `<yoto-avatar>`.
    #[arg(long)]
    embed: bool,
    /// Also show the link as a QR code in the terminal, for the camera of a phone.
    #[arg(long)]
    qr: bool,
    /// Address with which the link begins [default: the service's].
    #[arg(long, value_name = "URL")]
    at: Option<String>,
    #[command(flatten)]
    queue: QueueArgs,
    #[command(flatten)]
    server: Server,
}

impl Create {
    pub(super) async fn run(self) -> anyhow::Result<()> {
        let client = self.queue.apply(self.server.connect().await?);
        let job = match &self.job {
            Some(job) => client.find_job(job).await?.name,
            None => self.exported(&client).await?,
        };
        let ends = self.expires.map(|it| now() + it.as_secs_f64());
        let request = CreateShareRequest {
            job,
            note: self.note,
            embed: self.embed,
            expire_time: ends.map(|at| Timestamp {
                seconds: at as i64,
                nanos: 0,
            }),
        };
        let created = client.create_share(request).await?;
        let share = created.share.unwrap_or_default();
        let base = match self.at {
            Some(at) => at.trim_end_matches('/').to_owned(),
            None => self.server.addresses()?.first(),
        };
        let url = format!("{base}{}", created.path);
        output::put("share", output::message(&share));
        output::put("url", url.clone());
        say!("{url}");
        let end = share.expire_time.map_or_else(
            || "until it is revoked".to_owned(),
            |end| format!("until {end}"),
        );
        tell!("anyone with this link can see the page {end}; the link is not shown again");
        if self.qr {
            let code = QrCode::new(url.as_bytes()).context("the link is too long for a QR code")?;
            tell!("{}", code.render::<Dense1x2>().build());
        }
        if share.embed {
            tell!(
                "in a page of yours: <script src=\"{base}/assets/yoto-avatar.js\"></script><yoto-avatar src=\"{url}\"></yoto-avatar>"
            );
        }
        Ok(())
    }

    /// The job that has exported the person's page.
    async fn exported(&self, client: &YotoClient) -> anyhow::Result<String> {
        // Clap requires both.
        let model = self.model.as_deref().context("no model is given")?;
        let subject = self.subject.as_deref().context("no person is given")?;
        let spec = ExportSpec {
            model: client.find_model(model).await?.name,
            subject: client.find_subject(subject).await?.name,
            form: ExportForm::Page.into(),
            ..ExportSpec::default()
        };
        let job = client.export(spec).await?;
        let mut display = ProgressDisplay::new(format!("{subject} by {model}"));
        let job = wait_for_new(client, &job.name, &mut display).await?;
        display.clear();
        output::put("job", output::message(&job));
        Ok(job.name)
    }
}
