//! Tests of the page in a real browser; they are skipped if no browser is installed.

use std::{fs, path::Path, process};

use super::{NAMES, USUAL, mechid, page, rig};

/// Returns the text that a browser shows of the page in a frame of this width, in px, and the
/// errors that it reports; `None` if there is no browser.
///
/// The page is in a frame, because the window of a browser has a minimum width.
fn browse(folder: &Path, width: u32) -> Option<(String, String)> {
    let measure = "<script>addEventListener('load', () => {
        const beyond = [...document.querySelectorAll('body, body *')].filter(e =>
            e.getBoundingClientRect().right > innerWidth + 0.5 && !e.closest('.scroll > *, svg *'));
        parent.postMessage([innerWidth, document.documentElement.scrollWidth,
            ...beyond.map(e => e.tagName)].join(' '), '*');
    })</script>";
    // In the copy of the page, the security policy allows the script of this test and still forbids
    // loading other files.
    let own = page(folder);
    let hash = own.find("script-src").expect("a policy for the script");
    let end = hash + own[hash..].find('"').expect("the end of the policy");
    let allowed = own
        .replacen(&own[hash..end], "script-src 'unsafe-inline'", 1)
        .replace("</body>", &format!("{measure}</body>"));
    fs::write(folder.join("copy.html"), allowed).unwrap();
    let frame = format!(
        "<!DOCTYPE html><title>frame</title><script>addEventListener('message', e => {{
            document.querySelector('output').textContent = e.data;
        }})</script><output></output>
        <iframe src=\"copy.html\" width=\"{width}\" height=\"900\"></iframe>"
    );
    fs::write(folder.join("frame.html"), frame).unwrap();
    let browsers = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    let output = browsers.iter().find_map(|browser| {
        process::Command::new(browser)
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"])
            .args(["--enable-logging=stderr", "--virtual-time-budget=5000", "--dump-dom"])
            .arg(format!("--user-data-dir={}", folder.join(format!("profile{width}")).display()))
            .arg("--window-size=1400,1000")
            .arg(format!("file://{}", folder.join("frame.html").display()))
            .output()
            .ok()
    })?;
    let messages = String::from_utf8_lossy(&output.stderr);
    let console = messages.lines().filter(|line| line.contains("CONSOLE")).collect();
    let dom = String::from_utf8(output.stdout).unwrap();
    let seen = dom.split("<output>").nth(1).and_then(|s| s.split("</output>").next());
    Some((seen.unwrap_or(&dom).to_owned(), console))
}

#[test]
fn a_browser_shows_it_without_complaint_on_screen_and_telephone() {
    let folder = rig(NAMES, f64::INFINITY, 1e-3);
    let long = "long_name_of_a_column_without_any_place_to_break_it_".repeat(3);
    let again = rig(NAMES, f64::INFINITY, 1.1e-3);
    for (from, name) in [(&folder, "rig.csv"), (&again, "again.csv")] {
        let record = fs::read_to_string(from.path().join("rig.csv")).unwrap();
        let record = record.replacen("\"F\"", &format!("\"{long}\""), 1);
        fs::write(folder.path().join(name), record).unwrap();
    }
    let mut arguments = USUAL.to_vec();
    arguments[3] = &long;
    let more = ["again.csv", "--validate", "rig.csv", "--title", &long];
    mechid(folder.path(), &[&arguments[..], &more].concat());
    for width in [390, 1280] {
        let Some((seen, console)) = browse(folder.path(), width) else {
            eprintln!("skipped: no Chromium on this machine");
            return;
        };
        assert_eq!(console, "", "the browser complains");
        assert_eq!(seen, format!("{width} {width}"), "wider than the window");
    }
}
