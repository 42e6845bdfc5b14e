//! The table of what callers share. It stands in `docs/operate/capacity.md`.

use super::Filling;
use crate::audit::{of_key, of_tenant};
use crate::config::TrafficLimits;
use crate::webhooks;
use std::fmt::Write;

/// Something of which there is only so much.
struct Row {
    what: &'static str,
    total: String,
    owner: &'static str,
    share: String,
    reserve: &'static str,
}

/// The table in Markdown, for `limits` and those of a process that may open many files.
pub fn capacity_table(limits: &TrafficLimits) -> String {
    let mut table = String::from(
        "| what | in all | owner | share of an owner | who is not held up |\n|---|---|---|---|---|\n",
    );
    for Row {
        what,
        total,
        owner,
        share,
        reserve,
    } in rows(limits)
    {
        // Writing to a string does not fail.
        let _ = writeln!(
            table,
            "| {what} | {total} | {owner} | {share} | {reserve} |"
        );
    }
    table
}

/// How much of a pool with `total` places an owner alone gets.
fn free(total: usize) -> String {
    format!("as many as are free; alone {}", total / 2)
}

fn with_key(total: usize) -> String {
    format!("{}; a key {}", free(total), total.div_ceil(3))
}

fn listed(filling: Filling) -> String {
    let Filling { most, per_second } = filling;
    format!("{most} at once, then one per {} s", 1.0 / per_second)
}

fn rows(limits: &TrafficLimits) -> Vec<Row> {
    let many = limits.clone().for_files(u64::MAX);
    let by_files = |of: fn(&TrafficLimits) -> usize| {
        format!("{} with 1,024 open files, up to {}", of(limits), of(&many))
    };
    let mib = |bytes: u32| format!("{} MiB", bytes >> 20);
    vec![
        Row {
            what: "connections without an admitted call",
            total: by_files(|it| it.waiting_connections),
            owner: "address (IPv6: /64)",
            share: format!(
                "{}; {} s each",
                free(limits.waiting_connections),
                limits.first_call.as_secs()
            ),
            reserve: "new connections: the oldest gives way",
        },
        Row {
            what: "connections with an admitted call",
            total: by_files(|it| it.connections),
            owner: "tenant, key",
            share: with_key(limits.connections),
            reserve: "other callers, also from the same address",
        },
        Row {
            what: "open calls, scopes `read` and `write`",
            total: limits.user_calls.to_string(),
            owner: "tenant, key",
            share: with_key(limits.user_calls),
            reserve: "workers, operators, probes",
        },
        Row {
            what: "open calls, scope `work`",
            total: limits.worker_calls.to_string(),
            owner: "tenant, key",
            share: with_key(limits.worker_calls),
            reserve: "users, operators, probes",
        },
        Row {
            what: "open calls, scope `operate`",
            total: limits.operator_calls.to_string(),
            owner: "tenant, key",
            share: with_key(limits.operator_calls),
            reserve: "users, workers, probes",
        },
        Row {
            what: "open calls without a key",
            total: by_files(|it| it.open_calls),
            owner: "address",
            share: free(limits.open_calls),
            reserve: "callers with a key; `/healthz` and `/readyz` need no place",
        },
        Row {
            what: "open downloads",
            total: by_files(|it| it.downloads),
            owner: "tenant, key",
            share: with_key(limits.downloads),
            reserve: "a quarter of the open files for database, objects and jobs",
        },
        Row {
            what: "bytes of requests",
            total: mib(limits.bytes),
            owner: "tenant, key, connection",
            share: format!(
                "as many as are free; a key half of that; a connection {}",
                mib(limits.connection_bytes)
            ),
            reserve: "small calls: the first 64 KiB of each do not count",
        },
        Row {
            what: "calls per second",
            total: "by quota".to_owned(),
            owner: "tenant",
            share: "`calls_per_second`".to_owned(),
            reserve: "workers, which it does not count",
        },
        Row {
            what: "deliveries of webhooks at once",
            total: webhooks::AT_ONCE.to_string(),
            owner: "tenant, webhook",
            share: format!(
                "{}; a webhook {}",
                free(webhooks::AT_ONCE),
                webhooks::AT_ONCE.div_ceil(3)
            ),
            reserve: "other tenants and webhooks",
        },
        Row {
            what: "refused calls in the audit log",
            total: "unlimited, with the number of callers".to_owned(),
            owner: "tenant, key",
            share: format!(
                "tenant: {}; key: {}",
                listed(of_tenant(limits.refused_calls)),
                listed(of_key(limits.refused_calls))
            ),
            reserve: "calls beyond it are not carried out, and are counted in one entry per minute",
        },
        Row {
            what: "rows and bytes of objects, time of workers",
            total: "by quota".to_owned(),
            owner: "tenant",
            share: "`people`, `bytes`, `open_jobs`, `device_seconds`, `pictures`".to_owned(),
            reserve: "a worker runs the jobs of its key's tenant alone",
        },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_table_is_the_one_of_the_docs() {
        let table = capacity_table(&TrafficLimits::default());
        println!("{table}");
        let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/operate/capacity.md");
        let page = std::fs::read_to_string(page).expect("is readable");
        for line in table.lines() {
            assert!(
                page.lines().any(|it| it == line),
                "docs/operate/capacity.md lacks\n{line}"
            );
        }
    }
}
