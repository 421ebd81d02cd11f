//! Command line that reproduces a report.

use std::ffi::OsString;

use mechid::report::PageSettings;
use shlex::Quoter;

/// Returns `mechid` with these arguments, quoted for a POSIX shell.
fn command(arguments: &[OsString]) -> String {
    let quoter = Quoter::new().allow_nul(true);
    let mut command = String::from("mechid");
    for argument in arguments {
        let argument = argument.to_string_lossy();
        command.push(' ');
        command += &quoter
            .quote(&argument)
            .expect("NUL is the only character that can be refused, and it is allowed");
    }
    command
}

/// Returns the settings of a page that names the command with these arguments.
pub fn settings(arguments: &[OsString]) -> PageSettings {
    PageSettings { command: Some(command(arguments)), ..PageSettings::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_reads_the_same_arguments() {
        let arguments =
            ["report", "my rig.csv", "--title", "it's <b>", "--lines", "1:2:9", "", "é$x"];
        let command = command(&arguments.map(OsString::from));
        assert!(
            command.starts_with("mechid report 'my rig.csv' --title \"it's <b>\""),
            "{command}"
        );
        let read = shlex::split(&command).unwrap();
        assert_eq!(read[1..], arguments);
    }
}
