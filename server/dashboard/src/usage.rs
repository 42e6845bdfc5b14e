//! What the asker's tenant uses, beside what it may use.

use super::words::{badge, bytes, span, told, whole};
use maud::{Markup, html};
use yoto_proto::v1::{StoredBytes, Usage};

/// A table of the tenant's usage; a quota that is reached is marked.
pub(crate) fn table(usage: &Usage) -> Markup {
    let quota = usage.quota.unwrap_or_default();
    let seconds = |it: u64| span(it as f64);
    let most_seconds = quota.device_seconds.map(|it| it as u64);
    // What is used, what may be, and how both are written.
    type Row = (&'static str, u64, Option<u64>, fn(u64) -> String);
    let rows: [Row; 5] = [
        ("People", usage.people, quota.people, whole),
        ("Stored", usage.bytes, quota.bytes, bytes),
        ("Open jobs", usage.open_jobs, quota.open_jobs, whole),
        (
            "Device time, 30 days",
            usage.device_seconds as u64,
            most_seconds,
            seconds,
        ),
        ("Pictures, 30 days", usage.pictures, quota.pictures, whole),
    ];
    html! {
        h2 #usage { "Used by the tenant " (told(&usage.tenant)) }
        div .scroll tabindex="0" role="group" aria-label="Table" { table {
            thead { tr { th scope="col" { "what" } th scope="col" { "used" } th scope="col" { "at most" } } }
            tbody { @for (what, used, most, written) in rows { tr {
                th scope="row" { (what) }
                td { @if most.is_some_and(|most| used >= most) { (badge("bad", &written(used))) } @else { (written(used)) } }
                td { @match most { Some(most) => (written(most)), None => "–" } }
            } } }
        } }
        @if let Some(rate) = quota.calls_per_second { p .detail { "At most " (rate) " calls per second." } }
        @if let Some(stored) = &usage.stored { (kinds(stored)) }
    }
}

/// What is stored, by kind.
fn kinds(stored: &StoredBytes) -> Markup {
    let rows = [
        ("Uploads", stored.uploads),
        ("Frames, checks and pictures of captures", stored.captures),
        ("Checkpoints", stored.checkpoints),
        ("Renders, evaluations and exports", stored.results),
    ];
    let all: u64 = rows.iter().map(|it| it.1).sum();
    html! {
        div .scroll tabindex="0" role="group" aria-label="Table" { table {
            thead { tr { th scope="col" { "Stored" } th scope="col" { "bytes" } th scope="col" { "share" } } }
            tbody { @for (what, number) in rows {
                @let percent = 100 * u128::from(number) / u128::from(all.max(1));
                tr {
                    th scope="row" { (what) }
                    td { (bytes(number)) }
                    td { meter min="0" max="100" value=(percent) aria-label={ "share of " (what) } { (percent) " %" } }
                }
            } }
        } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use yoto_proto::v1::Quota;

    #[test]
    fn a_quota_that_is_reached_is_marked() {
        let usage = Usage {
            tenant: "lab".into(),
            people: 3,
            open_jobs: 1,
            quota: Some(Quota {
                people: Some(3),
                open_jobs: Some(2),
                ..Quota::default()
            }),
            ..Usage::default()
        };
        let page = table(&usage).into_string();
        let marked = format!("<td>{}</td><td>3</td>", badge("bad", "3").into_string());
        assert!(page.contains(&marked), "{page}");
        assert!(page.contains("<td>1</td><td>2</td>"), "{page}");
        assert_eq!(page.matches("badge").count(), 1, "{page}");
    }
    #[test]
    fn what_is_stored_is_told_by_kind() {
        let usage = Usage {
            stored: Some(StoredBytes {
                uploads: 1024,
                checkpoints: 3072,
                ..StoredBytes::default()
            }),
            ..Usage::default()
        };
        let page = table(&usage).into_string();
        assert!(page.contains("<td>3.0 KiB</td>"), "{page}");
        assert!(
            page.contains("value=\"75\"") && page.contains("value=\"25\""),
            "{page}"
        );
    }
}
