//! `yoto webhook`: addresses that are told when jobs end.

use crate::args::Server;
use crate::show::{self, ID, now, span};
use clap::{Args, Subcommand};
use yoto_client::pick_name;
use yoto_proto::names::Collection;
use yoto_proto::v1::Webhook;
use yoto_terminal::output::{self, others};

const AFTER_HELP: &str = "\
When a job ends, the service sends a POST with the job as JSON to each address, signed as Standard Webhooks specifies. It
repeats the request for a day, until the answer is 2xx.

Examples:
  yoto webhook create https://example.org/yoto --note 'renders are ready'
  yoto webhook list
  yoto webhook delete 3f1c0a2b";

const CREATE_HELP: &str = "\
The secret is the only line on stdout, and is shown once. The receiver checks signatures with it.

Example:
  yoto webhook create https://example.org/yoto > secret";

const LIST_HELP: &str = "\
Example:
  yoto webhook list";

const DELETE_HELP: &str = "\
Example:
  yoto webhook delete 3f1c0a2b";

/// Add, list and remove webhooks: addresses that the service calls when jobs end.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct WebhookCommand {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Add a webhook, and print the secret of its signatures once.
    #[command(after_help = CREATE_HELP)]
    Create {
        /// The address, which begins with https://.
        url: String,
        /// Purpose of the webhook, in one line.
        #[arg(long, value_name = "TEXT", default_value = "")]
        note: String,
        #[command(flatten)]
        server: Server,
    },
    /// List the webhooks, with the outcome of their last delivery.
    #[command(after_help = LIST_HELP)]
    List {
        #[command(flatten)]
        server: Server,
    },
    /// Remove a webhook.
    #[command(after_help = DELETE_HELP)]
    Delete {
        /// The webhook, by id.
        webhook: String,
        #[command(flatten)]
        server: Server,
    },
}

impl WebhookCommand {
    pub(crate) async fn run(self) -> anyhow::Result<()> {
        match self.action {
            Action::Create { url, note, server } => {
                let client = server.connect().await?;
                let created = client.create_webhook(&url, &note).await?;
                let webhook = created.webhook.unwrap_or_default();
                tell!("{} tells {}", webhook.name, others(&webhook.url));
                output::put("webhook", output::message(&webhook));
                output::put("secret", created.secret.clone());
                say!("{}", created.secret);
            }
            Action::List { server } => {
                let client = server.connect().await?;
                let all = client.list_webhooks().await?;
                output::put("webhooks", output::messages(&all));
                if all.is_empty() {
                    say!("no webhooks");
                    return Ok(());
                }
                let rows: Vec<Vec<String>> = all.iter().map(|it| row(it, now())).collect();
                let header = ["ID", "ADDRESS", "AGE", "WAITING", "LAST", "NOTE"];
                say!("{}", show::table(&header, &rows));
            }
            Action::Delete { webhook, server } => {
                let client = server.connect().await?;
                let known = client.list_webhooks().await?;
                let names = known.iter().map(|it| (it.name.as_str(), ""));
                let index = pick_name(Collection::Webhooks, &webhook, names)?;
                let name = &known[index].name;
                client.delete_webhook(name).await?;
                output::put("webhook", name.as_str());
                say!("{name} is removed");
            }
        }
        Ok(())
    }
}

/// A line of the table at `now`, seconds since 1970.
fn row(webhook: &Webhook, now: f64) -> Vec<String> {
    let id = webhook.name.split('/').next_back().unwrap_or_default();
    let ago =
        |at: &Option<prost_types::Timestamp>| at.as_ref().map(|at| span(now - at.seconds as f64));
    let last = match (ago(&webhook.last_time), webhook.last_error.as_str()) {
        (None, _) => "-".to_owned(),
        (Some(ago), "") => format!("told {ago} ago"),
        (Some(ago), error) => format!("{ago} ago: {}", others(error)),
    };
    vec![
        id.chars().take(ID).collect(),
        others(&webhook.url).to_string(),
        ago(&webhook.create_time).unwrap_or_else(|| "-".to_owned()),
        webhook.waiting.to_string(),
        last,
        others(&webhook.note).to_string(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_tells_whether_an_address_can_be_told() {
        let at = |seconds| Some(prost_types::Timestamp { seconds, nanos: 0 });
        let mut webhook = Webhook {
            name: "webhooks/0123456789abcdef".into(),
            url: "https://example.org/x".into(),
            note: "renders".into(),
            create_time: at(1000),
            ..Webhook::default()
        };
        let line = |webhook: &Webhook| row(webhook, 1060.0).join(" · ");
        assert_eq!(
            line(&webhook),
            "01234567 · https://example.org/x · 1m · 0 · - · renders"
        );
        webhook.last_time = at(1055);
        assert!(line(&webhook).contains("told 5s ago"));
        (webhook.last_error, webhook.waiting) = ("it has answered 500".into(), 2);
        assert!(line(&webhook).contains("2 · 5s ago: it has answered 500"));
    }
}
