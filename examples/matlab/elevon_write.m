function elevon_write(file, data)
% ELEVON_WRITE  A log for `elevon import`: a timetable, or a struct of columns with a field time [s].
%   Channels bear the names of roles (motor_speed, output_position, torque_current, ...), in SI:
%   `elevon list signals ACTUATOR` has them. columns.toml states that currents are peak values.
  if isstruct(data)
    content = data;
  else
    content = struct('time', seconds(data.Properties.RowTimes));
    for name = data.Properties.VariableNames
      content.(name{1}) = data.(name{1});
    end
  end
  if ~isfield(content, 'time')
    error('elevon:time', 'a log needs its time [s]');
  end
  names = fieldnames(content);
  for k = 1:numel(names)
    column = content.(names{k});
    if ~isnumeric(column) || numel(column) ~= numel(content.time)
      error('elevon:column', '%s: %d numbers are needed, as of the time', names{k}, ...
            numel(content.time));
    end
  end
  if exist('OCTAVE_VERSION', 'builtin')
    save('-v7', file, '-struct', 'content');
  else
    save(file, '-struct', 'content', '-v7');
  end
end
