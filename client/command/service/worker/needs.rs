//! Which jobs want a GPU, and the device for them.

use anyhow::ensure;
use clap::ValueEnum;
use yoto_device::PickedDevice;
use yoto_proto::v1::JobKind;

/// What the jobs of a worker compute on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Needs {
    /// Train, render, evaluate and export: they compute with networks.
    Gpu,
    /// Ingest: it reads films and pictures.
    Cpu,
}

/// Jobs that spend most of their time in networks.
const WITH_NETWORKS: &[JobKind] = &[
    JobKind::Train,
    JobKind::Render,
    JobKind::Evaluate,
    JobKind::Export,
];
/// Jobs that use no device but the processor.
const WITHOUT: &[JobKind] = &[JobKind::Ingest];

/// The kinds of jobs among `given` that agree with `needs`; without any given, all that do.
///
/// # Errors
/// When none does.
pub(super) fn kinds(needs: Option<Needs>, given: Vec<JobKind>) -> anyhow::Result<Vec<JobKind>> {
    let allowed = match needs {
        None => yoto_worker::agent::KINDS,
        Some(Needs::Gpu) => WITH_NETWORKS,
        Some(Needs::Cpu) => WITHOUT,
    };
    if given.is_empty() {
        return Ok(allowed.to_vec());
    }
    let kinds: Vec<JobKind> = given
        .into_iter()
        .filter(|it| allowed.contains(it))
        .collect();
    ensure!(
        !kinds.is_empty(),
        "--kinds and --needs have no kind of jobs in common: ingest needs a CPU alone, all others want a GPU"
    );
    Ok(kinds)
}

/// The device that `needs` asks for.
///
/// # Errors
/// When a GPU is needed, and this program can use no GPU of this machine.
pub(super) fn pick(needs: Option<Needs>) -> anyhow::Result<PickedDevice> {
    match needs {
        None => Ok(yoto_device::pick()),
        Some(Needs::Cpu) => Ok(yoto_device::cpu()),
        Some(Needs::Gpu) => {
            let picked = yoto_device::pick();
            let hint = yoto_device::hint_on_cpu();
            let hint = hint.map_or_else(String::new, |hint| format!(": {hint}"));
            ensure!(
                picked.info.gpu,
                "--needs gpu, but this program found only {}{hint}",
                picked.info.adapter
            );
            Ok(picked)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_needs_one_device() {
        let mut both = [WITH_NETWORKS, WITHOUT].concat();
        both.sort_unstable();
        let mut all = yoto_worker::agent::KINDS.to_vec();
        all.sort_unstable();
        assert_eq!(both, all);
    }

    #[test]
    fn given_kinds_are_limited_to_what_is_needed() {
        let given = vec![JobKind::Ingest, JobKind::Train];
        let of = |needs| kinds(needs, given.clone()).expect("some");
        assert_eq!(of(None), given);
        assert_eq!(of(Some(Needs::Gpu)), [JobKind::Train]);
        assert_eq!(of(Some(Needs::Cpu)), [JobKind::Ingest]);
        assert!(kinds(Some(Needs::Cpu), vec![JobKind::Train]).is_err());
    }

    #[test]
    fn a_gpu_that_is_not_there_is_named() {
        if yoto_device::pick().info.gpu {
            return;
        }
        let error = pick(Some(Needs::Gpu)).expect_err("has none");
        assert!(error.to_string().starts_with("--needs gpu, but"), "{error}");
    }
}
