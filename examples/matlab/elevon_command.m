function text = elevon_command(varargin)
% ELEVON_COMMAND  Runs the command line and returns what it prints; an error has its words.
%   elevon_command('simulate', 'torino-rotary', '--fidelity', 'low', '--out', 'run.mat')
  words = cellfun(@(word) ['"' strrep(word, '"', '\"') '"'], varargin, 'UniformOutput', false);
  [status, text] = system(['elevon ' strjoin(words, ' ') ' 2>&1']);
  if status ~= 0
    error('elevon:command', 'elevon %s: exit status %d\n%s', varargin{1}, status, text);
  end
end
