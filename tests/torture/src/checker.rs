//! Whether a history, and what is left at its end, keep the promises of the service.

#[cfg(test)]
mod tests;

use super::history::Event;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// States in which a job has ended.
const TERMINAL: [&str; 3] = ["SUCCEEDED", "FAILED", "CANCELLED"];

/// Most checkpoints of a model without a reason to keep: jobs that used them may end after the last one was
/// published.
const SPARE: usize = 4;

/// A job at the end.
#[derive(Debug, Clone, Default)]
pub(crate) struct FinalJob {
    /// Name of its state.
    pub state: String,
    /// Code and message of its error; empty without one.
    pub error: String,
    /// Its owner: the request id of the call that made it.
    pub owner: String,
    /// Numbers of its attempts and their outcomes, oldest first.
    pub attempts: Vec<(u64, String)>,
}

/// What the service says and stores at the end.
#[derive(Debug, Clone, Default)]
pub(crate) struct Final {
    /// All jobs by name.
    pub jobs: BTreeMap<String, FinalJob>,
    /// States of the captures of acknowledged uploads, and whether each has a reason if it is REJECTED.
    pub captures: BTreeMap<String, (String, bool)>,
    /// Keys of referenced objects that don't have the bytes of their reference, with what is wrong.
    pub damaged: Vec<(String, String)>,
    /// Number of objects that nothing refers to.
    pub orphans: usize,
    /// Numbers of checkpoints by model that nothing keeps.
    pub spare: BTreeMap<String, usize>,
    /// Answers to repetitions of acknowledged calls: request id and job.
    pub repeated: Vec<(String, String)>,
}

/// Broken promises, one line each.
#[derive(Debug, Default)]
pub struct Findings {
    /// Number of acknowledged jobs.
    pub acknowledged: usize,
    /// Acknowledged jobs that are gone or have not ended.
    pub lost: Vec<String>,
    /// Jobs with several accepted completions, or several jobs for one request.
    pub duplicated: Vec<String>,
    /// Jobs that left a terminal state, or whose fencing tokens fell.
    pub unordered: Vec<String>,
    /// Jobs that failed, or were cancelled without a request.
    pub failed: Vec<String>,
    /// Number of late writes.
    pub stale_tried: usize,
    /// Late writes that were accepted.
    pub stale_accepted: Vec<String>,
    /// Jobs that used damaged bytes.
    pub corrupt_loads: Vec<String>,
    /// Referenced objects that are missing or differ, without having been damaged by the plan.
    pub unreadable: Vec<String>,
    /// Number of objects that nothing refers to: the next collections remove them.
    pub orphans: usize,
    /// Models with more checkpoints than they keep.
    pub hoarded: Vec<String>,
    /// Acknowledged uploads that are neither READY nor REJECTED with reasons.
    pub uploads: Vec<String>,
    /// Seconds of each recovery, ascending.
    pub recoveries: Vec<f64>,
}

impl Findings {
    /// Whether all promises were kept.
    pub fn is_clean(&self) -> bool {
        self.broken().is_empty()
    }

    /// All broken promises.
    pub fn broken(&self) -> Vec<&str> {
        [
            &self.lost,
            &self.duplicated,
            &self.unordered,
            &self.failed,
            &self.stale_accepted,
            &self.corrupt_loads,
            &self.unreadable,
            &self.uploads,
            &self.hoarded,
        ]
        .into_iter()
        .flatten()
        .map(String::as_str)
        .collect()
    }

    /// The `share` quantile of all recoveries (nearest rank); `None` without any.
    pub fn recovery(&self, share: f64) -> Option<f64> {
        let rank = (share * self.recoveries.len() as f64).ceil() as usize;
        let at = rank.checked_sub(1)?;
        self.recoveries.get(at).copied()
    }
}

/// Checks the `events` and the state at the `end`.
pub(crate) fn check(events: &[Event], end: &Final) -> Findings {
    let mut found = Findings {
        orphans: end.orphans,
        ..Findings::default()
    };
    let deleted: BTreeSet<&str> = events
        .iter()
        .filter_map(|event| match event {
            Event::Deleted { name } => Some(name.as_str()),
            _ => None,
        })
        .collect();
    check_events(events, end, &deleted, &mut found);
    check_jobs(end, &mut found);
    check_failures(events, end, &mut found);
    check_requests(events, end, &mut found);
    let flipped: BTreeSet<&str> = events
        .iter()
        .filter_map(|event| match event {
            Event::Flipped { key, .. } => Some(key.as_str()),
            _ => None,
        })
        .collect();
    let unexpected = end
        .damaged
        .iter()
        .filter(|(key, _)| !flipped.contains(key.as_str()));
    found.unreadable = unexpected
        .map(|(key, fault)| format!("{key}: {fault}"))
        .collect();
    let hoarded = end.spare.iter().filter(|(_, spare)| **spare > SPARE);
    found.hoarded = hoarded
        .map(|(model, spare)| format!("{model} has {spare} checkpoints that nothing keeps"))
        .collect();
    found.recoveries.sort_by(f64::total_cmp);
    found
}

fn check_events(events: &[Event], end: &Final, deleted: &BTreeSet<&str>, found: &mut Findings) {
    let mut last: HashMap<&str, (&str, u64)> = HashMap::new();
    for event in events {
        match event {
            Event::Acknowledged { job, .. } => {
                found.acknowledged += 1;
                if deleted.contains(job.as_str()) {
                    continue;
                }
                match end.jobs.get(job) {
                    None => found.lost.push(format!("{job} is gone")),
                    Some(it) if !TERMINAL.contains(&it.state.as_str()) => {
                        found.lost.push(format!("{job} is {} at the end", it.state));
                    }
                    Some(_) => {}
                }
            }
            Event::Uploaded { capture } => check_upload(capture, end, deleted, found),
            Event::Seen {
                job,
                state,
                attempt,
            } => {
                if let Some((before, token)) = last.insert(job, (state, *attempt)) {
                    if attempt < &token {
                        let line = format!("{job}: token {attempt} after {token}");
                        found.unordered.push(line);
                    }
                    if TERMINAL.contains(&before) && before != state {
                        found
                            .unordered
                            .push(format!("{job}: {state} after {before}"));
                    }
                }
            }
            Event::Late {
                job,
                what,
                accepted,
            } => {
                found.stale_tried += 1;
                if *accepted {
                    found.stale_accepted.push(format!("{job}: {what}"));
                }
            }
            Event::Recovered { seconds, .. } => found.recoveries.push(*seconds),
            Event::Served { job, damaged, used } if damaged == used => {
                found.corrupt_loads.push(format!("{job} used {used}"));
            }
            _ => {}
        }
    }
}

fn check_upload(capture: &str, end: &Final, deleted: &BTreeSet<&str>, found: &mut Findings) {
    if deleted.contains(capture) {
        return;
    }
    match end.captures.get(capture) {
        Some((state, _)) if state == "READY" => {}
        Some((state, true)) if state == "REJECTED" => {}
        Some((state, _)) => found.uploads.push(format!("{capture} is {state}")),
        None => found.uploads.push(format!("{capture} is gone")),
    }
}

fn check_jobs(end: &Final, found: &mut Findings) {
    for (job, it) in &end.jobs {
        let accepted = it.attempts.iter().filter(|(_, how)| how == "SUCCEEDED");
        let accepted = accepted.count();
        if accepted > 1 || (accepted == 1 && it.state != "SUCCEEDED") {
            let line = format!("{job} is {} after {accepted} completions", it.state);
            found.duplicated.push(line);
        }
        if !it.attempts.is_sorted_by(|a, b| a.0 < b.0) {
            found
                .unordered
                .push(format!("{job}: attempts {:?}", it.attempts));
        }
    }
}

/// No job may fail because of faults outside it.
fn check_failures(events: &[Event], end: &Final, found: &mut Findings) {
    let (mut doomed, mut cancelled) = (BTreeSet::new(), BTreeSet::new());
    for event in events {
        match event {
            Event::Doomed { job } => drop(doomed.insert(job)),
            Event::Cancelled { job } => drop(cancelled.insert(job)),
            _ => {}
        }
    }
    for (job, it) in &end.jobs {
        let asked = match it.state.as_str() {
            "FAILED" => doomed.contains(job),
            "CANCELLED" => cancelled.contains(job),
            _ => true,
        };
        if !asked {
            found
                .failed
                .push(format!("{job} is {}: {}", it.state, it.error));
        }
    }
}

/// One request makes one job, however often it is sent.
fn check_requests(events: &[Event], end: &Final, found: &mut Findings) {
    let mut jobs: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for event in events {
        if let Event::Acknowledged { job, request } = event {
            jobs.entry(request).or_default().insert(job);
        }
    }
    for (job, it) in &end.jobs {
        jobs.entry(&it.owner).or_default().insert(job);
    }
    for (request, job) in &end.repeated {
        jobs.entry(request).or_default().insert(job);
    }
    for (request, jobs) in jobs {
        if !request.is_empty() && jobs.len() > 1 {
            found
                .duplicated
                .push(format!("request {request} made {jobs:?}"));
        }
    }
}
