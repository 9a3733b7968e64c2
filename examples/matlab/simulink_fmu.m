% An actuator as an FMU in a Simulink model: exported, placed, run. Needs Simulink.
% The model's step is a whole number of the FMU's; state of the FMU is saved with a SimState.
elevon_command('export', 'fmu', 'torino-rotary', '--fidelity', 'low', '--version', '2.0', ...
               '-o', 'actuator.fmu', '--force');
model = 'actuator_in_simulink';
new_system(model);
add_block('simulink_extras/FMU Import/FMU', [model '/actuator']);
set_param([model '/actuator'], 'FMUName', fullfile(pwd, 'actuator.fmu'));
set_param(model, 'SolverType', 'Fixed-step', 'FixedStep', '1e-3', 'StopTime', '1');
add_block('simulink/Sources/Sine Wave', [model '/command'], 'Amplitude', 'deg2rad(5)', ...
          'Frequency', '2*pi');
add_line(model, 'command/1', 'actuator/1');
sim(model);
