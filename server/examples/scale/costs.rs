//! What the calls of a simulation cost.

use nix::sys::resource::{UsageWho, getrusage};
use nix::sys::time::TimeVal;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::future::Future;
use std::time::Instant;

/// Calls of each kind.
#[derive(Default)]
pub(crate) struct Costs(BTreeMap<&'static str, Calls>);

/// Calls of one kind.
#[derive(Default)]
struct Calls {
    /// Seconds of each.
    seconds: Vec<f64>,
    /// Seconds that this process computed during all of them: the coordinators, SQLite, and the caller.
    computed: f64,
}

/// A call that has begun.
pub(crate) struct Begun {
    at: Instant,
    computed: f64,
}

impl Begun {
    /// A call that begins now.
    pub(crate) fn now() -> Self {
        Self {
            at: Instant::now(),
            computed: computed(),
        }
    }
}

/// Seconds that this process has computed so far.
fn computed() -> f64 {
    let seconds = |time: TimeVal| time.tv_sec() as f64 + time.tv_usec() as f64 * 1e-6;
    let usage = getrusage(UsageWho::RUSAGE_SELF);
    usage.map_or(0.0, |it| {
        seconds(it.user_time()) + seconds(it.system_time())
    })
}

impl Costs {
    /// Times a call.
    pub(crate) async fn time<T>(&mut self, kind: &'static str, call: impl Future<Output = T>) -> T {
        let begun = Begun::now();
        let answer = call.await;
        self.ended(kind, &begun);
        answer
    }

    /// Adds a call that ends now.
    pub(crate) fn ended(&mut self, kind: &'static str, begun: &Begun) {
        let calls = self.0.entry(kind).or_default();
        calls.seconds.push(begun.at.elapsed().as_secs_f64());
        calls.computed += computed() - begun.computed;
    }

    /// A row for each kind: calls per simulated second of `span`, their cost, and the shares of that time for which the service
    /// would be busy with them, one after the other, and for which a processor computes.
    pub(crate) fn table(mut self, span: f64) -> String {
        let mut table =
            "| call | per second | p50, ms | p99, ms | computed, ms | busy | processor |\n\
                         |---|---:|---:|---:|---:|---:|---:|\n"
                .to_owned();
        let (mut all, mut all_computed) = (0.0, 0.0);
        let mut rows = Vec::new();
        for (kind, Calls { seconds, computed }) in &mut self.0 {
            seconds.sort_by(f64::total_cmp);
            let count = seconds.len() as f64;
            let at = |share: f64| seconds[((count - 1.0) * share) as usize] * 1e3;
            let busy = seconds.iter().sum::<f64>() / span;
            all += busy;
            all_computed += *computed / span;
            let row = format!(
                "| {kind} | {:.1} | {:.2} | {:.2} | {:.2} | {:.1} % | {:.1} % |\n",
                count / span,
                at(0.5),
                at(0.99),
                *computed / count * 1e3,
                busy * 1e2,
                *computed / span * 1e2
            );
            rows.push((busy, row));
        }
        rows.sort_by(|a, b| b.0.total_cmp(&a.0));
        table.extend(rows.into_iter().map(|(_, row)| row));
        // A String takes all text.
        let _ = writeln!(
            table,
            "| all | | | | | {:.1} % | {:.1} % |",
            all * 1e2,
            all_computed * 1e2
        );
        table
    }
}
