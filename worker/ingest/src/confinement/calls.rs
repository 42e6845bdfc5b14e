//! System calls: seccomp (`man 2 seccomp`). A list of what is refused, since a list of what decoders and their libraries call
//! changes with each of their versions.

use super::Extent;
use nix::libc;
use seccompiler::{
    BackendError, BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition,
    SeccompFilter, SeccompRule, TargetArch, apply_filter,
};
use std::collections::BTreeMap;
use std::path::Path;

/// Rules of each call; without a rule, each use of the call matches.
type Rules = BTreeMap<i64, Vec<SeccompRule>>;

/// Calls by which a process reaches others, the network or the system, or changes files that it can't open.
const REFUSED: &[i64] = &[
    // The network. Landlock's rules are for TCP alone.
    libc::SYS_socket,
    libc::SYS_bind,
    libc::SYS_connect,
    libc::SYS_listen,
    libc::SYS_accept,
    libc::SYS_accept4,
    // A ring makes calls that no filter sees.
    libc::SYS_io_uring_setup,
    libc::SYS_io_uring_enter,
    libc::SYS_io_uring_register,
    // Other processes. A process that leaves the group would outlive it.
    libc::SYS_setsid,
    libc::SYS_setpgid,
    libc::SYS_ptrace,
    libc::SYS_process_vm_readv,
    libc::SYS_process_vm_writev,
    libc::SYS_pidfd_getfd,
    libc::SYS_pidfd_send_signal,
    libc::SYS_kcmp,
    libc::SYS_setpriority,
    // Modes, owners and times, of which Landlock has no rules.
    libc::SYS_fchmod,
    libc::SYS_fchmodat,
    libc::SYS_fchown,
    libc::SYS_fchownat,
    libc::SYS_utimensat,
    libc::SYS_setxattr,
    libc::SYS_lsetxattr,
    libc::SYS_fsetxattr,
    libc::SYS_removexattr,
    libc::SYS_lremovexattr,
    libc::SYS_fremovexattr,
    libc::SYS_mknodat,
    libc::SYS_name_to_handle_at,
    libc::SYS_open_by_handle_at,
    // Name spaces and mounts.
    libc::SYS_unshare,
    libc::SYS_setns,
    libc::SYS_mount,
    libc::SYS_umount2,
    libc::SYS_pivot_root,
    libc::SYS_chroot,
    libc::SYS_open_tree,
    libc::SYS_move_mount,
    libc::SYS_fsopen,
    libc::SYS_fsmount,
    libc::SYS_mount_setattr,
    // Parts of the kernel that decoders have no use for, in which faults are found.
    libc::SYS_bpf,
    libc::SYS_perf_event_open,
    libc::SYS_userfaultfd,
    libc::SYS_add_key,
    libc::SYS_request_key,
    libc::SYS_keyctl,
    libc::SYS_init_module,
    libc::SYS_finit_module,
    libc::SYS_delete_module,
    libc::SYS_kexec_load,
    libc::SYS_reboot,
    libc::SYS_swapon,
    libc::SYS_swapoff,
    libc::SYS_acct,
    libc::SYS_quotactl,
    libc::SYS_settimeofday,
    libc::SYS_clock_settime,
    libc::SYS_adjtimex,
    libc::SYS_clock_adjtime,
    libc::SYS_sethostname,
    libc::SYS_setdomainname,
    libc::SYS_syslog,
];

/// Their older forms, which later architectures do not have.
#[cfg(target_arch = "x86_64")]
const REFUSED_OLDER: &[i64] = &[
    libc::SYS_chmod,
    libc::SYS_chown,
    libc::SYS_lchown,
    libc::SYS_utime,
    libc::SYS_utimes,
    libc::SYS_futimesat,
    libc::SYS_mknod,
    libc::SYS_iopl,
    libc::SYS_ioperm,
    libc::SYS_modify_ldt,
];
#[cfg(not(target_arch = "x86_64"))]
const REFUSED_OLDER: &[i64] = &[];

/// Calls that start a process or another program.
#[cfg(target_arch = "x86_64")]
const STARTING: &[i64] = &[
    libc::SYS_fork,
    libc::SYS_vfork,
    libc::SYS_execve,
    libc::SYS_execveat,
];
#[cfg(not(target_arch = "x86_64"))]
const STARTING: &[i64] = &[libc::SYS_execve, libc::SYS_execveat];

/// Present where the kernel has seccomp.
const SUPPORT: &str = "/proc/sys/kernel/seccomp/actions_avail";

/// Refuses the calling thread all calls of the lists; those that start processes unless it `starts` programs.
pub(super) fn confine(starts: bool) -> Result<Extent, seccompiler::Error> {
    let Ok(arch) = TargetArch::try_from(std::env::consts::ARCH) else {
        return Ok(Extent::None);
    };
    if !Path::new(SUPPORT).exists() {
        return Ok(Extent::None);
    }
    let refused = filter(refused(starts)?, libc::EPERM, arch)?;
    apply_filter(&refused)?;
    if !starts {
        // Its flags are behind a pointer, which no filter follows. The C library then uses `clone`.
        let unseen = Rules::from([(libc::SYS_clone3, Vec::new())]);
        apply_filter(&filter(unseen, libc::ENOSYS, arch)?)?;
    }
    Ok(Extent::Full)
}

fn refused(starts: bool) -> Result<Rules, BackendError> {
    let mut rules: Rules = (REFUSED.iter().chain(REFUSED_OLDER))
        .map(|call| (*call, Vec::new()))
        .collect();
    // Limits of other processes; 0 is this one.
    let other = SeccompCondition::new(0, SeccompCmpArgLen::Dword, SeccompCmpOp::Ne, 0)?;
    rules.insert(libc::SYS_prlimit64, vec![SeccompRule::new(vec![other])?]);
    if !starts {
        rules.extend(STARTING.iter().map(|call| (*call, Vec::new())));
        let thread = libc::CLONE_THREAD as u64;
        let process = SeccompCondition::new(
            0,
            SeccompCmpArgLen::Qword,
            SeccompCmpOp::MaskedEq(thread),
            0,
        )?;
        rules.insert(libc::SYS_clone, vec![SeccompRule::new(vec![process])?]);
    }
    Ok(rules)
}

/// A filter that answers calls that match with the error number `answer`.
fn filter(rules: Rules, answer: i32, arch: TargetArch) -> Result<BpfProgram, BackendError> {
    SeccompFilter::new(
        rules,
        SeccompAction::Allow,
        SeccompAction::Errno(answer as u32),
        arch,
    )?
    .try_into()
}
