//! Every example runs without an error; its output is not checked.

/// Each example is a module here, so that one program runs them all.
macro_rules! examples {
    ($($name:ident $file:literal),+ $(,)?) => { $(
        #[path = $file]
        mod $name;

        #[test]
        fn $name() {
            $name::main().unwrap();
        }
    )+

        /// Checks that the list names every file of the examples: a file that is not in the list
        /// would never run.
        #[test]
        fn the_list_is_whole() {
            let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/examples");
            let files = std::fs::read_dir(folder).unwrap();
            let mut there: Vec<_> = files.map(|file| file.unwrap().file_name()).collect();
            there.sort();
            let listed = [$($file),+].map(|path| path.rsplit('/').next().unwrap());
            assert_eq!(there, listed);
        }
    };
}

examples! {
    identify_a_record "../examples/01_identify_a_record.rs",
    modes_of_a_test "../examples/02_modes_of_a_test.rs",
    find_the_force "../examples/03_find_the_force.rs",
    a_force_with_its_band "../examples/04_a_force_with_its_band.rs",
    design_measure_identify "../examples/05_design_measure_identify.rs",
    weigh_the_noise "../examples/06_weigh_the_noise.rs",
    force_through_noise "../examples/07_force_through_noise.rs",
    identify_a_bearing "../examples/08_identify_a_bearing.rs",
    a_long_record "../examples/09_a_long_record.rs",
    compare_schemes "../examples/10_compare_schemes.rs",
    choose_the_step "../examples/11_choose_the_step.rs",
    step_by_step "../examples/12_step_by_step.rs",
}
