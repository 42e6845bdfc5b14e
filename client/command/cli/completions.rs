//! `yoto completions`: command lines that a shell completes.

use crate::cli::Cli;
use clap::{Args, CommandFactory};
use clap_complete::Shell;

const AFTER_HELP: &str = "\
Examples:
  yoto completions bash > ~/.local/share/bash-completion/completions/yoto
  yoto completions zsh > ~/.zfunc/_yoto
  yoto completions fish > ~/.config/fish/completions/yoto.fish";

/// Print a script with which a shell completes commands and options.
#[derive(Debug, Args)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Completions {
    /// The shell.
    shell: Shell,
}

impl Completions {
    pub(crate) fn run(self) -> anyhow::Result<()> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "yoto", &mut script);
        say!("{}", String::from_utf8(script)?.trim_end());
        Ok(())
    }
}
