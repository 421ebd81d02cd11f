//! Names, units and instants as measuring programs write them above and beside the numbers.

use mechid_io::{Evidence, Quantity, Table, TimeAxis};

use super::table;

/// Reads a text and checks its three columns: instants every half second, a force of 1 to 4, and an
/// acceleration of 5 to 8.
fn three(text: &str) -> Table {
    let table = table(text);
    assert_eq!(table.len(), 4, "{text}");
    for (column, first) in [(1, 1.0), (2, 5.0)] {
        let expected: Vec<f64> = (0..4).map(|k| first + f64::from(k)).collect();
        assert_eq!(table.values(column).unwrap(), expected, "{text}");
    }
    table
}

const ROWS: &str = "0.0,1,5\n0.5,2,6\n1.0,3,7\n1.5,4,8\n";

#[test]
fn a_comment_above_the_table_names_its_columns() {
    let blanks = ROWS.replace(',', " ");
    for text in [
        format!("# time [s],force [N],acc [g]\n{ROWS}"),
        format!("% time [s],force [N],acc [g]\n{ROWS}"),
        format!("! time [s],force [N],acc [g]\n{ROWS}"),
        format!("; time [s],force [N],acc [g]\n{ROWS}"),
        format!("# Rig 4, left\n# time [s];force [N];acc [g]\n{ROWS}"),
        format!("# time [s]  force [N]  acc [g]\n{blanks}"),
        format!("# time [s] force [N] acc [g]\n{blanks}"),
        format!("# time, force, acc\n# s, N, g\n{ROWS}"),
        format!("# time force acc\ns,N,g\n{ROWS}"),
    ] {
        let table = three(&text);
        assert_eq!(table.time_column().map(|name| &name[..4]), Some("time"), "{text}");
        let acc = table.find("acc").unwrap();
        assert!(
            (table.to_si(acc, Quantity::ACCELERATION).unwrap() - 9.80665).abs() < 1e-12,
            "{text}"
        );
        assert_eq!(table.to_si(1, Quantity::Force).unwrap(), 1.0, "{text}");
    }
    // These comments are not names of columns: the first has two words for three columns, and the
    // second has numbers.
    for text in [format!("# rig 4\n{ROWS}"), format!("# 1,2,3\n{ROWS}")] {
        assert_eq!(three(&text).names(), ["", "", ""], "{text}");
    }
}

/// Names and units are also read if other lines follow them, so that the force of the first row is
/// 1 kN. Reference: the definitions of the units.
#[test]
fn names_and_units_above_other_lines_are_read() {
    let blanks = ROWS.replace(',', " ");
    let mut texts = vec![
        "# time,force [kN],acc [g]\n# 512 rows\n".to_owned(),
        "# time,force [kN],acc [g]\n# -----------\n".into(),
        "# time,force [kN],acc [g]\n#\n".into(),
        "# time,force [kN],acc [g]\n\n".into(),
        "# time,force [kN],acc [g]\n# run by Hans\n".into(),
        "# time,force [kN],acc [g]\n# Halle,left,raw\n".into(),
        "# Columns: time, force [kN], acc [g]\n".into(),
        "# units: s, kN, g\ntime,force,acc\n".into(),
        "# Unit = s, kN, g\n# recorded at night\ntime,force,acc\n".into(),
        "# time, force, acc\n# s, kN, g\n# sampled in s\n".into(),
        "time,force,acc\n# s,kN,g\n".into(),
        "# time,force [kN],acc [g]\ntime,force,acc\n".into(),
        "s,kN,g\ntime,force,acc\n".into(),
    ];
    for row in ["CH1,CH2,CH3", "Clock,Shaker head,Top plate", "Zeit,Kraft,Deckel"] {
        for units in ["s,kN,g", "[s],[kN],[g]"] {
            texts.push(format!("time,force,acc\n{units}\n{row}\n"));
        }
        texts.push(format!("time,force [kN],acc [g]\n{row}\nCH1,CH2,CH3\n"));
    }
    let mut texts: Vec<String> = texts.iter().map(|above| format!("{above}{ROWS}")).collect();
    texts.push(format!("# time force acc\n# (s) (kN) (g)\n# ---- ---- ---\n{blanks}"));
    texts.push(format!("# time, force [kN], acc [g]\n# end\n{blanks}"));
    for text in texts {
        let table = three(&text);
        assert!(table.time_column().is_some_and(|name| name.starts_with("time")), "{text}");
        let [force, acc] = ["force", "acc"].map(|name| table.find(name).unwrap());
        assert_eq!(table.to_si(force, Quantity::Force).unwrap(), 1e3, "{text}");
        let si = table.to_si(acc, Quantity::ACCELERATION).unwrap();
        assert!((si - 9.80665).abs() < 1e-12, "{text}");
    }
}

/// Names and units are read from one comment line for each column, so that the force of the first
/// row is 1 kN. Reference: the definitions of the units.
#[test]
fn definitions_of_columns_in_lines_of_their_own_are_read() {
    let mut texts = Vec::new();
    for [before, after] in
        [["Column ", ": "], ["col. ", " = "], ["", " - "], ["", ") "], ["Ch", ": "], ["- ", ": "]]
    {
        for first in [0, 1] {
            let line = |at: usize, text: &str| format!("# {before}{}{after}{text}\n", at + first);
            let lines = [line(0, "time [s]"), line(1, "force [kN]"), line(2, "acc [g]")].concat();
            texts.push(format!("# Rig: 4\n{lines}# 512 samples\n"));
            texts.push(format!("{lines}time,force,acc\n"));
        }
    }
    for above in [
        "# time: instant in s\n# force: hammer [kN]\n# acc: beam, tip (g)\n",
        "# acc = g\n# force = kN\n# Rig: 4\n",
        "# force: head of the hammer in kN\n# acc - acceleration of the tip in g\n",
    ] {
        texts.push(format!("{above}time,force,acc\n"));
        texts.push(format!("{above}time,force [kN],acc [g]\n"));
    }
    texts.push("# time: [s]\n# force: in kN\n# acc: tip [g]\n".into());
    for text in texts {
        let table = three(&format!("{text}{ROWS}"));
        assert!(table.time_column().is_some_and(|name| name.starts_with("time")), "{text}");
        let [force, acc] = ["force", "acc"].map(|name| table.find(name).unwrap());
        assert_eq!(table.to_si(force, Quantity::Force).unwrap(), 1e3, "{text}");
        let si = table.to_si(acc, Quantity::ACCELERATION).unwrap();
        assert!((si - 9.80665).abs() < 1e-12, "{text}");
    }
    // A list of definitions that omits a column gives no names, because some columns would have
    // none.
    let table = three(&format!("# 2: force [kN]\n# 3: acc [g]\n{ROWS}"));
    assert!((0..3).all(|column| table.unit(column).is_none()), "{}", table.available());
    assert!(table.find("acc").is_err(), "{}", table.available());
    // No units are read from definitions whose numbers do not begin with 0 or 1, from ranges, or
    // from sensitivities.
    for above in [
        "# 2 force [kN]\n# 3 acc [g]\n",
        "# force: range 5 kN\n# acc: 50 g\n",
        "# force: 11.2 mV/kN\n# acc: sensor 352, 10 mV/g\n",
    ] {
        let table = three(&format!("{above}time,force,acc\n{ROWS}"));
        assert_eq!(table.to_si(1, Quantity::Force).unwrap(), 1.0, "{above}");
        assert_eq!(table.to_si(2, Quantity::ACCELERATION).unwrap(), 1.0, "{above}");
    }
}

/// Names of several words are read with their units, so that the force of the first row is 1 kN.
/// Reference: the definitions of the units.
#[test]
fn names_of_several_words_above_aligned_columns_are_read() {
    let rows = ROWS.replace(',', "      ");
    for header in [
        "time (s)  force (kN)   acc (g)",
        "  time [s] force [kN] acc [g]",
        "   time   hammer force [kN]    acc [g] ",
        "time  hammer force  tip acc\ns     kN            g",
        "time  force  acc\n(s)   (kN)  (g)",
        "time  force (hammer)   acc\n s   kN   g",
        "   s     kN      g\ntime  hammer force  tip acc",
    ] {
        let table = three(&format!("{header}\n{rows}"));
        assert!(table.time_column().is_some_and(|name| name.starts_with("time")), "{header}");
        assert_eq!(table.to_si(1, Quantity::Force).unwrap(), 1e3, "{header}");
        let si = table.to_si(2, Quantity::ACCELERATION).unwrap();
        assert!((si - 9.80665).abs() < 1e-12, "{header}");
        // The hint names the number of lines above the names of the columns.
        let error = Table::parse("a.txt", format!("Rig 4\n{header}\n{rows}").as_bytes());
        let error = error.unwrap_err().to_string();
        assert!(error.ends_with("`skip_lines` 1"), "{header}: {error}");
    }
}

/// A unit that is not understood is reported, also if it is in a comment or above a further row.
#[test]
fn units_that_are_not_understood_above_other_lines_are_reported() {
    for above in [
        "# time,force [V],acc [g]\n# 512 rows\n",
        "# units: s, V, g\ntime,force,acc\n",
        "time,force,acc\ns,kN/V,g\nClock,Shaker,Plate\n",
        "time,force,acc\nClock,Shaker [V],Plate\nCH1,CH2,CH3\n",
    ] {
        let table = three(&format!("{above}{ROWS}"));
        let stated = table.stated_unit(1, Some(Quantity::Force));
        let stated = stated.unwrap_or_else(|| panic!("{above}"));
        assert_eq!(stated.evidence, Evidence::Unused, "{above}");
        assert!(stated.text.contains('V'), "{above}{stated:?}");
    }
}

#[test]
fn rows_above_the_names_are_left_out() {
    for above in [
        "1,2,3\n",
        "CH1,CH2,CH3\n",
        "Channel 1,Channel 2,Channel 3\n",
        "Serial,1234,5\nRange,10,100\n",
        "File,a,b\nRig,c,d\nOperator,e,f\n",
    ] {
        for units in ["", "s,N,g\n", "[s],[N],[g]\n", "(s),(N),(g)\n"] {
            if units.is_empty() && above.starts_with("File") {
                continue;
            }
            let table = three(&format!("{above}time,force,acc\n{units}{ROWS}"));
            assert_eq!(table.names(), ["time", "force", "acc"], "{above}{units}");
            let factor = if units.is_empty() { 1.0 } else { 9.80665 };
            let si = table.to_si(2, Quantity::ACCELERATION).unwrap();
            assert!((si - factor).abs() < 1e-12, "{above}{units}: {si}");
        }
    }
}

#[test]
fn one_name_more_than_fields_does_no_harm() {
    let table = three(&format!("X_Value,Force,Acc,Comment\n{ROWS}"));
    assert_eq!(table.names(), ["X_Value", "Force", "Acc", "Comment"]);
    assert_eq!(table.time_column(), Some("X_Value"));
    let table =
        three(&format!("X_Value,Force,Acc,Comment\n{}", ROWS.replacen("5\n", "5,start\n", 1)));
    assert_eq!(table.sampling(&TimeAxis::Column("1"), &["2"]).unwrap().dt(), 0.5);
}

/// Dates and clock times are read as a time axis with steps of half a second.
#[test]
fn instants_of_dates_and_clocks_are_a_time_axis() {
    for (name, instants) in [
        (
            "time",
            [
                "2023-03-14T23:59:59.000",
                "2023-03-14T23:59:59.500",
                "2023-03-15T00:00:00.000",
                "2023-03-15T00:00:00.500",
            ],
        ),
        (
            "time",
            [
                "2023-03-14 09:26:53.0",
                "2023-03-14 09:26:53.5",
                "2023-03-14 09:26:54.0",
                "2023-03-14 09:26:54.5",
            ],
        ),
        ("Time [hh:mm:ss]", ["09:26:53.0", "09:26:53.5", "09:26:54.0", "09:26:54.5"]),
        ("time", ["23:59:59.0", "23:59:59.5", "00:00:00.0", "00:00:00.5"]),
        ("time", ["11:59:59.5 PM", "12:00:00.0 AM", "12:00:00.5 AM", "12:00:01.0 AM"]),
        ("time", ["59:59.0", "59:59.5", "00:00.0", "00:00.5"]),
        (
            "Timestamp",
            [
                "3/14/2023 9:26:53.0 PM",
                "3/14/2023 9:26:53.5 PM",
                "3/14/2023 9:26:54.0 PM",
                "3/14/2023 9:26:54.5 PM",
            ],
        ),
    ] {
        let rows = instants.iter().enumerate().map(|(k, at)| format!("{at},{},{}\n", k + 1, k + 5));
        let rows: String = rows.collect();
        for header in [format!("{name},force,acc\n"), String::new()] {
            let table = three(&format!("{header}{rows}"));
            let time = if header.is_empty() { "1" } else { table.time_column().unwrap() };
            let sampling = table.sampling(&TimeAxis::Column(time), &["2"]).unwrap();
            assert!((sampling.dt() - 0.5).abs() < 1e-9, "{name}: {}", sampling.dt());
            assert!(table.says_unit_of_time(0));
        }
    }
    let back = table("time,x\n09:26:53.0,1\n09:26:53.5,2\n09:26:53.0,3\n09:26:53.5,4\n");
    let error = back.sampling(&TimeAxis::Column("time"), &["x"]).unwrap_err().to_string();
    assert!(error.contains("had been appended"), "{error}");
    let mixed = table("time,x\n2023-03-14T09:26:53,1\n0.5,2\n2023-03-14T09:26:54,3\n");
    let error = mixed.column("time").unwrap_err().to_string();
    assert!(error.contains("line 3") && error.contains("is not a number"), "{error}");
}

/// Times are read in the unit that the name of the column states; `samples` is not a unit of time
/// and is reported.
#[test]
fn units_of_time_are_read_or_named() {
    for (name, factor) in [
        ("Time (msec)", 1e-3),
        ("TIME(S)", 1.0),
        ("Zeit [ms]", 1e-3),
        ("time [h]", 3600.0),
        ("Time_usec", 1e-6),
    ] {
        let table = three(&format!("{name},force,acc\n{ROWS}"));
        let sampling =
            table.sampling(&TimeAxis::Column(table.time_column().unwrap()), &["2"]).unwrap();
        assert!((sampling.dt() / (0.5 * factor) - 1.0).abs() < 1e-12, "{name}");
    }
    let table = three(&format!("time [samples],force,acc\n{ROWS}"));
    assert_eq!(table.time_column(), None);
    assert_eq!(table.unclear_time(), Some((0, "samples".into())));
}

/// The header of a LabVIEW measurement file.
fn lvm(x_columns: &str, names: &str, rows: &str, steps: [f64; 2]) -> String {
    let head = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n\
                Multi_Headings\tNo\n";
    let segment = "Time_Pref\tAbsolute\nOperator\tlab\nDate\t2020/02/02\nTime\t10:11:12.5\n***End_of_Header***\t\n\t\n\
                   Channels\t2\t\t\nSamples\t4\t4\t\nDate\t2020/02/02\t2020/02/02\t\nTime\t10:11:12.5\t10:11:12.5\t\n\
                   Y_Unit_Label\tN\tg\t\nX_Dimension\tTime\tTime\t\nX0\t0.0E+0\t0.0E+0\t\n";
    let [a, b] = steps;
    format!(
        "{head}X_Columns\t{x_columns}\n{segment}Delta_X\t{a}\t{b}\t\n***End_of_Header***\t\t\t\n{names}\n{rows}"
    )
}

#[test]
fn labview_measurement_files_are_read_with_their_units_and_time() {
    let one = lvm("One", "X_Value\tForce\tAcc\tComment", &ROWS.replace(',', "\t"), [0.5; 2]);
    let none: String = (0..4).map(|k| format!("\t{}\t{}\n", k + 1, k + 5)).collect();
    let none = lvm("No", "X_Value\tForce\tAcc\tComment", &none, [0.5; 2]);
    let each: String = (0..4)
        .map(|k| {
            let t = 0.5 * f64::from(k);
            format!("{t}\t{}\t{t}\t{}\n", k + 1, k + 5)
        })
        .collect();
    let each = lvm("Multi", "X_Value\tForce\tX_Value\tAcc\tComment", &each, [0.5; 2]);
    for (kind, text) in [("One", one), ("No", none), ("Multi", each)] {
        for text in [text.clone(), text.replace('\n', "\r\n")] {
            let table = table(&text);
            let [force, acc] = ["Force", "Acc"].map(|name| table.find(name).unwrap());
            assert_eq!(table.values(force).unwrap(), [1.0, 2.0, 3.0, 4.0], "{kind}");
            assert_eq!(table.values(acc).unwrap(), [5.0, 6.0, 7.0, 8.0], "{kind}");
            assert_eq!(table.to_si(force, Quantity::Force).unwrap(), 1.0, "{kind}");
            assert!(
                (table.to_si(acc, Quantity::ACCELERATION).unwrap() - 9.80665).abs() < 1e-12,
                "{kind}"
            );
            let time = if table.has_time_axis() {
                TimeAxis::OfFile
            } else {
                TimeAxis::Column(table.time_column().unwrap())
            };
            assert_eq!(table.sampling(&time, &["Force", "Acc"]).unwrap().dt(), 0.5, "{kind}");
        }
    }
}

#[test]
fn channels_of_different_rates_in_a_labview_file_are_refused_together() {
    let rows: String = (0..4)
        .map(|k| format!("{}\t1\t{}\t2\n", 0.5 * f64::from(k), 0.25 * f64::from(k)))
        .collect();
    let table = table(&lvm("Multi", "X_Value\tForce\tX_Value\tAcc", &rows, [0.5, 0.25]));
    let error = table.sampling(&TimeAxis::OfFile, &["Force", "Acc"]).unwrap_err().to_string();
    assert!(error.contains("same time axis"), "{error}");
    assert_eq!(table.sampling(&TimeAxis::OfFile, &["Acc"]).unwrap().dt(), 0.25);
}

/// In files with a column of instants for each channel, LabVIEW leaves the field above the instants
/// empty. The third channel has no unit, so that the field of this unit is also empty.
#[test]
fn channels_with_their_own_instants_have_their_own_units() {
    let above = "LabVIEW Measurement\t\nSeparator\tTab\nX_Columns\tMulti\n***End_of_Header***\t\n\t\n\
                 Channels\t4\n";
    let names = "X_Value\tForce\tX_Value\tAcc\tX_Value\tState\tX_Value\tDisp\tComment";
    let row = |t: f64| format!("{t}\t1\t{t}\t2\t{t}\t3\t{t}\t4\n");
    let rows: String = (0..4).map(|k| row(0.5 * f64::from(k))).collect();
    let aligned = "Samples\t4\t\t4\t\t4\t\t4\nY_Unit_Label\tkN\t\tg\t\t\t\tmm\nX0\t0\t\t0\t\t0\t\t0\n\
                   Delta_X\t0.5\t\t0.5\t\t0.5\t\t0.5\n";
    let packed = "Samples\t4\t4\t4\t4\nY_Unit_Label\tkN\tg\t\tmm\nX0\t0\t0\t0\t0\n\
                  Delta_X\t0.5\t0.5\t0.5\t0.5\n";
    let only_units_packed = aligned.replace("kN\t\tg\t\t\t\tmm", "kN\tg\t\tmm");
    for header in [aligned, packed, &only_units_packed] {
        let end = "***End_of_Header***\t\t\t";
        let table = table(&format!("{above}{header}{end}\n{names}\n{rows}"));
        for (name, quantity, factor) in [
            ("Force", Quantity::Force, 1e3),
            ("Acc", Quantity::ACCELERATION, 9.80665),
            ("Disp", Quantity::DISPLACEMENT, 1e-3),
        ] {
            let at = table.find(name).unwrap();
            let si = table.to_si(at, quantity).unwrap();
            assert!((si / factor - 1.0).abs() < 1e-12, "{header}{name}: {si}");
        }
        assert_eq!(table.unit(table.find("State").unwrap()), None, "{header}");
        assert_eq!(table.sampling(&TimeAxis::OfFile, &["Force", "Disp"]).unwrap().dt(), 0.5);
    }
}

/// A comment with names or units for fewer or more columns than the table has is not read, and a
/// remark says so.
#[test]
fn comments_with_another_number_of_fields_are_reported() {
    let numbers = "0,1,2\n0.1,2,3\n0.2,1,1\n";
    for (above, comment) in [
        ("# t, F\n", "t, F"),
        ("# t [s], F [kN], x [mm], note\n", "t [s], F [kN], x [mm], note"),
        ("# units: s kN\n", "units: s kN"),
        ("% F in kN, x in mm\n", "F in kN, x in mm"),
        ("t,F,x\n# s,kN\n", "s,kN"),
        ("t,F,x\n# [s], [kN], [mm], [-]\n", "[s], [kN], [mm], [-]"),
        ("# columns: time force\n", "columns: time force"),
    ] {
        let table = Table::parse("a.csv", format!("{above}{numbers}").as_bytes()).unwrap();
        let [remark] = table.remarks() else { panic!("{above}: {:?}", table.remarks()) };
        assert!(remark.contains(&format!("\"{comment}\"")), "{above}: {remark}");
        assert!(remark.contains("3 columns"), "{above}: {remark}");
    }
    for above in [
        "# t, F, x\n",
        "# t, F, x\n# s, kN, mm\n",
        "# Measured on rig 4, by hand\n",
        "# Rig 4\nt,F,x\n",
        "# Monday, the first of March, in the hall\n",
        "# a, b\n# a note\nt,F,x\n",
        "# a, b\nt,F,x\n",
        "# sampled at 100 Hz\n",
        "# 3, 4\n",
    ] {
        let table = Table::parse("a.csv", format!("{above}{numbers}").as_bytes()).unwrap();
        assert_eq!(table.remarks(), [] as [String; 0], "{above}");
    }
}
