//! Hints as texts that the database passes on.

use std::collections::BTreeMap;
use yoto_store::{JobKind, Tenant};

/// Bytes of a text: PostgreSQL takes less than 8000 (<https://www.postgresql.org/docs/current/sql-notify.html>).
const TEXT_BYTES: usize = 7900;

/// Something that others may want to look at.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Hint {
    /// The job `jobs/{id}` has changed.
    Changed(String),
    /// A job of the tenant waits for a worker of this kind.
    Queued(String, &'static str),
}

impl Hint {
    /// A job of this kind waits for a worker.
    pub(crate) fn queued(tenant: &Tenant, kind: JobKind) -> Self {
        Self::Queued(tenant.id().to_owned(), kind.as_str())
    }

    fn line(&self, count: u32) -> String {
        match self {
            Self::Changed(job) => format!("\nchanged {job}"),
            Self::Queued(tenant, kind) => format!("\nqueued {tenant} {kind} {count}"),
        }
    }
}

/// What a hint asks for.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Heard {
    /// Watchers of the job look at it.
    Changed(String),
    /// As many workers of the tenant and the kind ask for a job.
    Queued(Tenant, JobKind, u32),
}

/// Texts with all `hints`, in which the first line is the sender.
pub(super) fn texts(sender: &str, hints: &BTreeMap<Hint, u32>) -> Vec<String> {
    let mut texts = Vec::new();
    let mut text = sender.to_owned();
    for (hint, count) in hints {
        let line = hint.line(*count);
        if text.len() + line.len() > TEXT_BYTES {
            texts.push(std::mem::replace(&mut text, sender.to_owned()));
        }
        text.push_str(&line);
    }
    texts.push(text);
    texts
}

/// The hints of a text that somebody else than `own` has sent. Lines of a newer version are passed over.
pub(super) fn heard(own: &str, text: &str) -> Vec<Heard> {
    let mut lines = text.lines();
    if lines.next() == Some(own) {
        return Vec::new();
    }
    lines.filter_map(read).collect()
}

fn read(line: &str) -> Option<Heard> {
    match line.split(' ').collect::<Vec<_>>()[..] {
        ["changed", job] => Some(Heard::Changed(job.to_owned())),
        ["queued", tenant, kind, count] => Some(Heard::Queued(
            Tenant::new(tenant)?,
            JobKind::of_column(kind).ok()?,
            count.parse().ok()?,
        )),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn others_read_what_was_sent_and_the_sender_does_not() {
        let own = Tenant::default();
        let mut hints = BTreeMap::from([(Hint::queued(&own, JobKind::Render), 3)]);
        for number in 0..1000 {
            hints.insert(Hint::Changed(format!("jobs/{number:036}")), 1);
        }
        let texts = texts("a", &hints);
        assert!(texts.len() > 1 && texts.iter().all(|it| it.len() <= TEXT_BYTES));
        let read: Vec<Heard> = texts.iter().flat_map(|it| heard("b", it)).collect();
        assert_eq!(read.len(), hints.len());
        assert!(read.contains(&Heard::Queued(own, JobKind::Render, 3)));
        assert!(read.contains(&Heard::Changed(format!("jobs/{:036}", 7))));
        assert!(texts.iter().all(|it| heard("a", it).is_empty()));
    }

    #[test]
    fn other_texts_are_passed_over() {
        for text in [
            "",
            "a\nsomething new",
            "a\nqueued ? render 1",
            "a\nqueued default sing 1",
        ] {
            assert_eq!(heard("b", text), [], "{text}");
        }
    }
}
