//! The number of files that the service may open: connections, downloads and objects are files.

#[cfg(unix)]
use nix::sys::resource::{Resource, getrlimit, setrlimit};

/// Open files that are enough for all connections and calls that the service admits.
#[cfg(unix)]
const WANTED: u64 = 65_536;

/// Raises the soft limit of open files, 1,024 on many systems, to what the hard limit allows, and returns it. A system that refuses
/// leaves it as it is, and the log says so; `None` if the system does not tell it.
pub(super) fn raise() -> Option<u64> {
    #[cfg(unix)]
    match raised() {
        Ok(files) => return Some(files),
        Err(error) => tracing::warn!(%error, "the limit of open files stays as it is"),
    }
    None
}

#[cfg(unix)]
fn raised() -> nix::Result<u64> {
    let (soft, hard) = getrlimit(Resource::RLIMIT_NOFILE)?;
    let wanted = hard.min(WANTED);
    if soft >= wanted {
        return Ok(soft);
    }
    setrlimit(Resource::RLIMIT_NOFILE, wanted, hard)?;
    tracing::debug!(before = soft, now = wanted, "open files");
    Ok(wanted)
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn the_soft_limit_rises_and_never_falls() {
        let (_, hard) = getrlimit(Resource::RLIMIT_NOFILE).expect("limits");
        setrlimit(Resource::RLIMIT_NOFILE, hard.min(512), hard).expect("lowers");
        assert_eq!(raised(), Ok(hard.min(WANTED)));
        let raised_to = getrlimit(Resource::RLIMIT_NOFILE).expect("limits");
        assert_eq!(raised_to, (hard.min(WANTED), hard));
        assert_eq!(raised(), Ok(raised_to.0));
        assert_eq!(
            getrlimit(Resource::RLIMIT_NOFILE).expect("limits"),
            raised_to
        );
    }
}
